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

DECKS = {"deck.inp": ABAQUS, "parts.inp": PARTS, "deck.bdf": NASTRAN, "deck.cdb": ANSYS, "deck.unv": UNIVERSAL}
