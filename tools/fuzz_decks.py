"""Small decks that tools/fuzz spoils: what tools/mesh reads of each code."""

AT = [(x, y, z) for z in (0, 1, 1, 2) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]

ABAQUS = """*HEADING
two bricks
*NODE, NSET=all
""" + "".join(f"{i}, {x}, {y}, {z}\n" for i, (x, y, z) in enumerate(AT, 1)) + """100, 0.5, 0.5, 3
101, 0.5, 0.5, 5
*NODE
102, 0.5, 0.5, 5
*NGEN, NSET=made
101, 102, 1
*SYSTEM
0,0,0, 1,0,0
0,1,0
*ELEMENT, TYPE=C3D8, ELSET=low
1, 1,2,3,4,5,6,7,8
*ELEMENT, TYPE=C3D8, ELSET=high
2, 9,10,11,12,13,14,15,16
*ELEMENT, TYPE=SPRING2, ELSET=soft
3, 100, 101
*ELEMENT, TYPE=MASS, ELSET=lump
4, 100
*ELEMENT, TYPE=B31, ELSET=rod
5, 100, 101
*ELSET, ELSET=both, GENERATE
1, 2, 1
*NSET, NSET=base
1, 2, 3, 4
*SURFACE, NAME=low_top
low, S2
*SURFACE, NAME=high_bottom
high, S1
*SURFACE, NAME=high_top
high, S2
*MATERIAL, NAME=m
*ELASTIC, TYPE=ENGINEERING CONSTANTS
5e9,4e9,3e9,.1,.2,.3,2e9,1e9,
3e9
*MATERIAL, NAME=n
*ELASTIC
2e11, 0.25
*DENSITY
7800
*DAMPING, BETA=1e-7
*ORIENTATION, NAME=o, SYSTEM=CYLINDRICAL
0,0,0, 0,0,1
*SOLID SECTION, ELSET=low, MATERIAL=m, ORIENTATION=o
*SOLID SECTION, ELSET=high, MATERIAL=n
*BEAM SECTION, ELSET=rod, SECTION=RECT, MATERIAL=n
0.1, 0.2
0,1,0
*SPRING, ELSET=soft
3, 3
2e6
*MASS, ELSET=lump
3
*COUPLING, CONSTRAINT NAME=grip, REF NODE=100, SURFACE=high_top
*KINEMATIC
1, 6
*EQUATION
2
101, 3, 1., 102, 3, -1.
*MPC
BEAM, 101, 100
*TRANSFORM, NSET=base, TYPE=C
0,0,0, 0,0,1
*BOUNDARY
base, 1
base, ENCASTRE
100, 1, 2, 0.001
*SURFACE INTERACTION, NAME=rub
*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR
1e12
*FRICTION, EXPONENTIAL DECAY
0.5, 0.4, 2.
*CONTACT PAIR, INTERACTION=rub
high_bottom, low_top
*STEP, NAME=press
*STATIC
*CLOAD
100, 3, -7
base, 1, 2
*DSLOAD
high_top, P, 1e5
*DLOAD
both, GRAV, 9.81, 0, 0, -1
high, P3, 5
*END STEP
*STEP
*STATIC
*CHANGE FRICTION, INTERACTION=rub
*FRICTION
0.3
*MOTION, ROTATION, TYPE=VELOCITY
low_top, 20., 0,0,0, 0,0,1
*NSET, NSET=low_top
5, 6, 7, 8
*END STEP
*STEP
*COMPLEX FREQUENCY
20, , 8000.
*END STEP
"""

PARTS = """*PART, NAME=p
*NODE
1, 0,0,0
2, 1,0,0
3, 0,1,0
4, 0,0,1
*ELEMENT, TYPE=C3D4, ELSET=e
1, 1,2,3,4
*SOLID SECTION, ELSET=e, MATERIAL=m
*SURFACE, NAME=s
e, S1
*END PART
*ASSEMBLY, NAME=a
*INSTANCE, NAME=i, PART=p
5., 0., 0.
0,0,0, 0,0,1, 30.
*END INSTANCE
*INSTANCE, NAME=j, PART=p
*END INSTANCE
*NODE
1, 9,9,9
*NSET, NSET=r
1
*NSET, NSET=n, INSTANCE=j
1, 2
*COUPLING, REF NODE=r, SURFACE=i.s
*KINEMATIC
*TIE, NAME=t
i.s, j.s
*END ASSEMBLY
*BOUNDARY
n, 1, 3
j.3, 1
"""

NASTRAN = """SOL 103
CEND
SPC = 1
LOAD = 3
SET 9 = 1 THRU 4
BEGIN BULK
$HMNAME PROP                   1"low" 4
CORD2C,5,,0.,0.,0.,0.,0.,1.
,1.,0.,0.
""" + "".join(f"GRID,{i},,{x}.,{y}.,{z}.\n" for i, (x, y, z) in enumerate(AT, 1)) + """GRID,100,,.5,.5,3.
GRID*                101               0              .5              .5
*                     5.
CHEXA,1,1,1,2,3,4,5,6
,7,8
CHEXA          2       2       9      10      11      12      13      14
+             15      16
PSOLID,1,1,5
PSOLID,2,2
MAT1,1,2.+11,,.25,7800.
MAT9,2,4.,1.,1.,,,,4.
,1.,,,,4.,,,
,2.,,,2.,,2.,1.
SPC1,1,123,1,THRU,4
SPC,1,13,1,0.5
RBE2,7,100,123456,13,14,15,16
RBE3,8,,101,123456,1.,123,9,10
CONM2,9,100,,5.
PELAS,3,4.+6
CELAS1,10,3,13,2,100,2
PBUSH,4,K,1.,2.,3.,4.,5.,6.
CBUSH,11,4,100,101,1.,0.,0.
PBARL,5,1,,BAR
,.1,.2
CBAR,12,5,100,101,1.,0.,0.
FORCE,2,100,,4096.,0.,0.,-1.
MOMENT,2,100,,3.,0.,0.,1.
PLOAD4,2,2,3.+5,,,,13,15
GRAV,2,,9.81,0.,0.,-1.
LOAD,3,2.,5.,2
SET,4,GRID,LIST,,,,,
,1,2
SURF,11,ELFACE,,,,,,
,1,5,7
SURF,12,ELFACE,,,,,,
,2,9,11
PCONT,50,,,0.4
CONTACT,1,50,12,11
PRETENS,60,,11,VECTOR,0.,0.,1.
PRETENS,61,12
PTFORCE,70,60,500.
PTFORC1,70,9.,61
EIGRL,5,,9000.
PARAM,G,0.02
ENDDATA
"""

ANSYS = """/COM,ANSYS RELEASE 19.2
/PREP7
ET,1,185
ET,2,170
ET,3,174
ET,4,179
ET,5,154
ET,6,14
NBLOCK,6,SOLID,16,16
(3i9,6e21.13e3)
""" + "".join(f"{i:9d}{0:9d}{0:9d}{x:21.13E}{y:21.13E}{z:21.13E}\n" for i, (x, y, z) in enumerate(AT, 1)) + """N,R5.3,LOC,       -1,
EBLOCK,19,SOLID,4,4
(19i9)
""" + "".join("".join(f"{v:9d}" for v in [m, kind, 7, 1, 0, 0, 0, 0, len(of), 0, n, *of]) + "\n" for n, m, kind, of in (
    (1, 1, 1, range(1, 9)), (2, 1, 1, [9, 10, 11, 11, 13, 14, 15, 15]), (3, 3, 2, range(5, 9)), (4, 3, 3, [9, 10, 11, 11]), (5, 1, 4, [5, 9, 40]), (6, 1, 6, [13, 40]))) + """       -1
CMBLOCK,BASE,NODE,       2
(8i10)
         1        -4
CMBLOCK,LOW,ELEM,       1
(8i10)
         1
MPDATA,R5.0, 1,EX  ,     1, 1, 2.00000000E+11    ,
MPDATA,R5.0, 1,NUXY,     1, 1, 0.250000000    ,
MPDATA,R5.0, 1,DENS,     1, 1, 7800.00000    ,
MPDATA,R5.0, 1,MU  ,     3, 1, 0.400000000    ,
D,      1,UX  ,  0.00000000    ,  0.00000000
D,      2,ALL ,  0.00000000    ,  0.00000000
F,13,FZ,-8.,0.
F,14,FZ,-8.,0.
KEYOPT,3,12,0
N,30,1.,1.,2.,45.
N,40,.5,.5,3.
CE,R5.0,DEFI,4,1,0.
CE,R5.0,NODE,13,UX,1.,40,UX,-1.
CE,R5.0,NODE,40,ROTY,1.,40,ROTZ,-.5
CE,2,0,14,UZ,1,40,UZ,-1
SECTYPE,4,PRETENSION,,M12
SECDATA,40,0.,0.,1.
SLOAD,4,PL01,LOCK,FORC,500.,1,2
SECTYPE,5,SHELL
SECBLOCK,1
 0.002, 1, 0, 3
SFE,2,2,PRES,1,3.E5,3.E5,3.E5,3.E5
SFE,1,1,PRES,0,R5.0
 3.E5 3.E5 3.E5 3.E5
OMEGA,0,0,3.
R,7,2.E6,3.
MODOPT,QRDAMP,20,0,8000
BETAD,1.E-7
CMROTATE,LOW,,,10.
ACEL,0.,0.,9.81
FINISH
"""

UNIVERSAL = """    -1
  2411
         1         1         1        11
   0.0   0.0   0.0
         2         1         1        11
   1.0   0.0   0.0
         3         1         1        11
   0.0   1.0   0.0
         4         1         1        11
   0.0   0.0   1.0
    -1
    -1
  2412
         1        21         2         1         7         2
         0         1         1
         1         2
         2        41         2         1         7         3
         1         3         2
         3       111         2         1         7         4
         1         2         3         4
    -1
    -1
  2467
         1         0         0         0         0         0         0         1
foot
         8         2         0         0
         2         0         0         0         0         0         0         2
tips
         7         3         0         0         7         4         0         0
    -1
"""



def small(*values):
    return "".join(f"{v:<8}" if i == 0 else f"{v:>8}" for i, v in enumerate(values)) + "\n"


OPTISTRUCT = """$$ OptiStruct Input Deck Generated by HyperMesh
ANALYSIS MODAL
SUBCASE 1
  SPC = 1
  LOAD = 2
BEGING BULK
$HMNAME COMP                   1"low" 1 "low" 4
""" + "".join(small("GRID", i, "", f"{x:.1f}", f"{y:.1f}", f"{z:.1f}") for i, (x, y, z) in enumerate(AT, 1)) + "".join((
    small("GRID", 100, 1, "0.0", "0.0", "1.0", 1), small("GRID", 101, "", ".5", ".5", "1.+1"), small("GRID", 102, "", "1.5", ".5", "3.0"),
    small("CORD1R", 1, 13, 101, 102), small("CHEXA", 1, 1, *range(1, 7)), small("+", 7, 8), small("CHEXA", 2, 2, *range(9, 15)), small("+", 15, 16),
    small("CQUAD8", 3, 3, 13, 14, 15, 16), small("PSOLID", 1, 1), small("PSOLID", 2, 1), small("PSHELL", 3, 1, ".1", 1),
    small("MAT1", 1, "2.+11", "", ".25", "7800."), small("SPC1", 1, 123, 1, "THRU", 4), small("SPC", 1, 100, 0, "0.0"),
    small("PBUSH", 4, "K", "RIGID", "2.0"), small("CBUSH", 11, 4, 101, 102), small("PBEAML", 5, 1, "", "ROD"), small("+", ".1", "", "YES", ".5"),
    small("CBEAM", 12, 5, 101, 102, "0.0", "1.0", "0.0"), small("QVOL", 2, "5.0", 1, 1), small("BSURFS", 1, "", "", "", 1, 5, 6, 7), small("BSURF", 2, 3), small("BCTSET", 9, 2, 1, ".4"), small("FORCE", 2, 13, 0, "1.0", "1.0", "0.0", "0.0"),
    small("RBE3", 8, "", 101, 123, "1.0", 123, 9), small("+", 10, 11))) + "ENDDATA\n"


def wide(*values):
    return "".join(f"{v:9d}" for v in values) + "\n"


WORKBENCH = """/batch
*DIM,_dir,string,248
_dir(1) = 'D:\\work\\'
/prep7
nblock,3,,17
(1i9,3e20.9e3)
""" + "".join(f"{i:9d}{x:20.9E}{y:20.9E}{z:20.9E}\n" for i, (x, y, z) in enumerate([*AT, (0.5, 0.5, 3)], 1)) + (
    '/wb,elem,start  ! set\n/com,*** Elements for Body 1 "SYS\\Disc" ***\net,1,185\neblock,19,solid,,1\n(19i9)\n'
    + wide(1, 1, 1, 1, 0, 0, 0, 0, 8, 0, 1, *range(1, 9)) + '-1\n/com,*** Elements for Body 2 "Pad" ***\net,2,185\neblock,19,solid,,1\n(19i9)\n'
    + wide(2, 2, 2, 1, 0, 0, 0, 0, 8, 0, 2, *range(9, 17)) + "-1\nMP,EX,1,2e11,\t! Pa\nMP,NUXY,1,0.3,\nMP,DENS,1,7850,\nMP,EX,2,2e11,\nMP,UVID,1,6a30-54\n"
    "*set,tid,5\n*set,cid,4\net,cid,174\net,tid,170\nkeyo,cid,12,5\nmp,mu,cid,0.3\neblock,10,,,1\n(15i9)\n" + wide(40, 4, 4, 4, 0, 9, 12, 11, 10)
    + "-1\neblock,10,,,1\n(15i9)\n" + wide(50, 5, 4, 4, 0, 5, 6, 7, 8) + "-1\n*set,tid,7\n*set,cid,6\net,cid,174\net,tid,170\neblock,10,,,1\n(15i9)\n"
    + wide(60, 6, 6, 6, 0, 13, 14, 15, 16) + "-1\n*set,_npilot,17\n_npilot9=_npilot\ntype,tid\nmat ,cid\nreal,cid\ntshape,pilo\nen,61,_npilot\ntshape\n"
    "et,9,154\neblock,10,,,1\n(15i9)\n" + wide(90, 9, 9, 9, 0, 13, 14, 15, 16) + "-1\n*DIM,_load,TABLE,2,1,1,TIME,\n_load(1,1,1) = 0.\n_load(2,1,1) = 1000.\n"
    "esel,s,type,,9\nnsle\nsf,all,pres,%_load%\nsfe,all,1,pres,1,3.\nnsel,all\nesel,all\nCMBLOCK,_FIXEDSU,NODE,        2\n(8i10)\n         1        -4\n"
    "cmsel,s,_FIXEDSU\nd,all,all\nnsel,all\nnsel,s,node,,13,16\ncm,top,node\nallsel\nf,top,fz,-3.\nd,_npilot9,ux,%_load%\nd,17,uz,0. $ d,17,uy,0.\n/solu\nsolve\nfini\n")

BLOCKS = ANSYS.replace("ET,1,185\nET,2,170\nET,3,174\nET,4,179\nET,5,154\nET,6,14\n", "ETBLOCK,        6,        6\n(2i9,19a9)\n" + "".join(
    wide(*row) for row in ((1, 185, 0, 1), (2, 170, 0), (3, 174, *[0] * 11, 5), (4, 179), (5, 154), (6, 14))) + "       -1\n") + (
    "DBLOCK,         2\n(i9,a6,2(pg16.9))\n        1  UZ    0.00000000      0.00000000    \n        2  UZ    0.00000000      0.00000000    \n"
    "SFEBLOCK,4,PRES,         1,         2,0\n(i9,i4,i4,6(pg20.9))\n        2   6   1      30.0      30.0      30.0      30.0\n        2   6   2      0.0      0.0\n"
    "SFE,end,LOC,       -1,\nACEL,0.,0.,9.81                                                         S     11\n")

CALCULIX = ABAQUS.replace("CONSTRAINT NAME=grip, REF NODE=100", "CONSTRAINTNAME=grip, REFNODE=100").replace("*SURFACE INTERACTION, NAME=rub\n", """*TRANSFORM, NSET=base, TYPE=C
0,0,0, 0,0,1
*NSET, NSET=lid
13, 14
*SURFACE, NAME=lid, TYPE=NODE
13,
15,
*ELEMENT, TYPE=DCOUP3D, ELSET=mean
9, 102
*DISTRIBUTING COUPLING, ELSET=mean
13, 1.
lid, 2.
*BOUNDARY
base, 0, 0, 20.
100, 11, 11, 3.
*MPC
PLANE, base
*TIE, CYCLIC SYMMETRY, NAME=t
high_bottom, low_top
*SURFACE INTERACTION, NAME=glue
*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TIED
1e9
*CONTACT PAIR, INTERACTION=glue
high_bottom, lid
*SURFACEINTERACTION, NAME=rub
""")

VTK = """# vtk DataFile Version 4.2
two tetrahedra
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 5 double
0 0 0
1 0 0
0 1 0
0 0 1
1 1 1
CELLS 2 10
4 0 1 2 3
4 1 2 3 4
CELL_TYPES 2
10
10
CELL_DATA 2
SCALARS part int 1
LOOKUP_TABLE default
1
2
"""

# a shell of 8 nodes and one of 6 beside it, whose upper surface has the nodes
PLATE = [(0, 0), (2, 0), (2, 1), (0, 1), (1, 0), (2, .5), (1, 1), (0, .5), (4, 0), (3, 0), (3, .5)]
SHELLS = {
    "shells.inp": "*NODE\n" + "".join(f"{i}, {x}, {y}, 0\n" for i, (x, y) in enumerate(PLATE, 1))
    + "*ELEMENT, TYPE=S8R, ELSET=plate\n1, 1,2,3,4,5,6,7,8\n*ELEMENT, TYPE=STRI65, ELSET=plate\n2, 2,9,3,10,11,6\n*MATERIAL, NAME=m\n*ELASTIC\n"
    "2e11, 0.25\n*DENSITY\n7800\n*SHELL SECTION, ELSET=plate, MATERIAL=m, OFFSET=SPOS\n0.125\n*NSET, NSET=base\n1, 4, 8\n*BOUNDARY\nbase, 1, 6\n",
    "shells.bdf": "BEGIN BULK\n" + "".join(f"GRID,{i},,{x:.1f},{y:.1f},0.\n" for i, (x, y) in enumerate(PLATE, 1))
    + "CQUAD8,1,1,1,2,3,4,5,6\n,7,8,,,,,,-.0625\nCTRIA6,2,1,2,9,3,10,11,6\n,,TOP\nPSHELL,1,1,.125,1\nMAT1,1,2.+11,,.25,7800.\nSPC1,1,123456,1,4,8\n",
    "shells.cdb": "/PREP7\nET,1,281\nNBLOCK,6,SOLID,11,11\n(3i9,6e21.13e3)\n"
    + "".join(f"{i:9d}{0:9d}{0:9d}{x:21.13E}{y:21.13E}\n" for i, (x, y) in enumerate(PLATE, 1)) + "N,R5.3,LOC,       -1,\nEBLOCK,19,SOLID,2,2\n(19i9)\n"
    + wide(1, 1, 1, 1, 0, 0, 0, 0, 8, 0, 1, *range(1, 9)) + wide(1, 1, 1, 1, 0, 0, 0, 0, 8, 0, 2, 2, 9, 3, 3, 10, 11, 3, 6)
    + "       -1\nSECTYPE,1,SHELL\nSECDATA,0.125,1\nSECOFFSET,TOP\nMP,EX,1,2e11\nMP,NUXY,1,0.25\nMP,DENS,1,7800\nD,1,ALL,0.\nD,4,ALL,0.\nFINISH\n"}

DECKS = {"deck.inp": ABAQUS, "parts.inp": PARTS, "deck.bdf": NASTRAN, "deck.cdb": ANSYS, "deck.unv": UNIVERSAL, "deck.fem": OPTISTRUCT,
         "ds.dat": WORKBENCH, "blocks.cdb": BLOCKS, "calculix.inp": CALCULIX, "deck.vtk": VTK, **SHELLS}
