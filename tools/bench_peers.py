"""Programs of the peers of tools/bench, each run by the python that has its modules."""

PEER = r'''
import ctypes, json, sys, time, resource
try: ctypes.CDLL("libmpi.so.40", ctypes.RTLD_GLOBAL).MPI_Init(None, None)  # a MUMPS that was built for MPI wants it
except OSError: pass
import numpy as np, scipy.sparse as sp, mumps
from numba import njit
clock = time.process_time
@njit(cache=True)
def gauss_seidel(G, b, start, mu, tol):
    nc = len(b)//3; r = start.copy(); u = G@r+b; norm = np.sqrt((b*b).sum()); it = 0
    while it < 20000:
        it += 1
        for i in range(nc):
            k = 3*i; o0, o1, o2 = r[k], r[k+1], r[k+2]
            c0 = u[k]-G[k,k]*o0-G[k,k+1]*o1-G[k,k+2]*o2; c1 = u[k+1]-G[k+1,k]*o0-G[k+1,k+1]*o1-G[k+1,k+2]*o2
            c2 = u[k+2]-G[k+2,k]*o0-G[k+2,k+1]*o1-G[k+2,k+2]*o2; dt = .5*(G[k+1,k+1]+G[k+2,k+2])+abs(G[k+1,k+2])
            x, y, z = o0, o1, o2
            for s in range(200):
                xp, yp, zp = x, y, z; x = max(0., -(c0+G[k,k+1]*y+G[k,k+2]*z)/G[k,k])
                w1 = c1+G[k+1,k]*x+G[k+1,k+1]*y+G[k+1,k+2]*z; w2 = c2+G[k+2,k]*x+G[k+2,k+1]*y+G[k+2,k+2]*z
                y -= w1/dt; z -= w2/dt; t = np.sqrt(y*y+z*z)
                if t > mu*x: y *= mu*x/t; z *= mu*x/t
                if abs(x-xp)+abs(y-yp)+abs(z-zp) <= 1e-13*(1e-300+abs(x)): break
            r[k], r[k+1], r[k+2] = x, y, z; d0, d1, d2 = x-o0, y-o1, z-o2
            if d0 != 0 or d1 != 0 or d2 != 0:
                for j in range(3*nc): u[j] += G[k,j]*d0+G[k+1,j]*d1+G[k+2,j]*d2
        u = G@r+b; s = 0.
        for i in range(nc):
            k = 3*i; ut = np.sqrt(u[k+1]**2+u[k+2]**2); a, c, e = r[k]-u[k]-mu*ut, r[k+1]-u[k+1], r[k+2]-u[k+2]; nt = np.sqrt(c*c+e*e)
            if nt <= mu*a: x, y, z = a, c, e
            elif mu*nt <= -a: x, y, z = 0., 0., 0.
            else: x = (mu*nt+a)/(mu*mu+1); y = mu*x*c/nt; z = mu*x*e/nt
            s += (r[k]-x)**2+(r[k+1]-y)**2+(r[k+2]-z)**2
        if np.sqrt(s) < tol*norm: break
    return r, it
folder, steps = sys.argv[1], int(sys.argv[2]); d = np.load(folder+"/all.npz")
M, C, K, B = (sp.csr_matrix((d[k+"_data"], d[k+"_indices"], d[k+"_indptr"]), tuple(d[k+"_shape"])) for k in "MCKB")
h, th, mu = %(h)r, .5, %(mu)r; u, v, F = d["u"].copy(), d["v"].copy(), d["F"]; n, m = B.shape[1], B.shape[0]
t = clock(); c = mumps.Context(); c.set_matrix((M+h*th*C+(h*th)**2*K).tocsc()); c.factor(); factor = clock()-t
t = clock(); Bt = B.T.tocsc(); Y = np.column_stack([c.solve(Bt[:, [k]].toarray().ravel()) for k in range(m)])
G = np.ascontiguousarray(B@Y); condensed = clock()-t
pardiso = 0.
try:
    import pypardiso; P = pypardiso.PyPardisoSolver(mtype=11); A = (M+h*th*C+(h*th)**2*K).tocsr(); t = clock(); P.factorize(A)
    W = np.hstack([B@P.solve(A, np.asfortranarray(Bt[:, k:k+256].toarray())) for k in range(0, m, 256)]); pardiso = clock()-t
    assert abs(W-G).max() < 1e-9*abs(G).max(); del W, P
except ImportError: pass
traj, belt = [], np.tile([0., %(belt)r, 0.], m//3); gauss_seidel(G[:3,:3].copy(), np.ones(3), np.zeros(3), mu, 1.)
for tol in (1e-12, 1e-8):  # the first to compare answers, the second to tell times
    u, v, r, took, cont, its = d["u"].copy(), d["v"].copy(), np.zeros(m), [], [], []
    for k in range(steps):
        t = clock(); free = c.solve(M@v-h*(1-th)*(C@v)-h*(K@(u+h*th*(1-th)*v))+h*F); b = B@free-belt; b[0::3] += B[0::3]@(u+h*(1-th)*v)/h
        t1 = clock(); n_, s_ = r[0::3], np.hypot(r[1::3], r[2::3]); stuck = (n_ > 0) & (mu*n_-s_ > 1e-8*n_.max())
        past = (1-th)/th*(B@v-belt); past[0::3] = 0; past.reshape(-1, 3)[stuck] = 0; it, turned = 0, True
        while np.any(turned):  # friction opposes the mean sliding velocity of the step, or that of its end where a pair would turn back
            r, more = gauss_seidel(G, b+past, r, mu, tol); it += more; p = past.reshape(-1, 3)
            turned = (r[0::3] > 0) & (((G@r+b+past).reshape(-1, 3)*p).sum(1) < (p*p).sum(1)); p[turned] = 0
        t2 = clock(); w = free+Y@r; u = u+h*(th*w+(1-th)*v); v = w; took.append(clock()-t); cont.append(t2-t1); its.append(it)
        if tol < 1e-8: traj += [u, v]
np.concatenate(traj).tofile(folder+"/peer.traj")
print(json.dumps(dict(step=float(np.median(took[1:])), contact=float(np.median(cont[1:])), cold=cont[0], factor=factor, condensed=condensed, pardiso=pardiso,
                      iterations=float(np.mean(its)), resident_MB=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss/1024)))
'''


SICONOS = r'''
import json, sys, time
import numpy as np, scipy.sparse as sp, siconos.kernel as sk, siconos.numerics as sn
folder, steps = sys.argv[1], int(sys.argv[2]); d = np.load(folder+"/all.npz"); clock = time.process_time
M, C, K, B = (sp.csr_matrix((d[k+"_data"], d[k+"_indices"], d[k+"_indptr"]), tuple(d[k+"_shape"])) for k in "MCKB")
n, pairs = B.shape[1], B.shape[0]//3; huge = 1e6*M.diagonal().sum()
M, C, K = (sp.block_diag([A, [[x]]]).toarray() for A, x in ((M, huge), (C, 0.), (K, 0.)))
u, v, F = np.append(d["u"], 0.), np.append(d["v"], %(belt)r), np.append(d["F"], 0.)  # named: Siconos keeps addresses
system = sk.LagrangianLinearTIDS(u, v, M, K, C); system.setFExtPtr(F)
model = sk.NonSmoothDynamicalSystem(0., 1e9); model.insertDynamicalSystem(system); kept = []
law = sk.NewtonImpactFrictionNSL(0., 0., %(mu)r, 3)
for i in range(pairs):
    rows = np.zeros((3, n+1)); rows[:, :n] = B[3*i:3*i+3].toarray(); rows[1, n] = -1.
    relation = sk.LagrangianLinearTIR(rows); one = sk.Interaction(law, relation); model.link(one, system); kept.append((relation, one))
if sys.argv[3] == "global":
    scheme, problem = sk.MoreauJeanGOSI(.5), sk.GlobalFrictionContact(3, sn.SICONOS_GLOBAL_FRICTION_3D_ADMM)
    problem.setMStorageType(sn.NM_SPARSE)
else:
    scheme, problem = sk.MoreauJeanOSI(.5), sk.FrictionContact(3, sn.SICONOS_FRICTION_3D_NSGS); problem.setMStorageType(sn.NM_DENSE)
options = problem.numericsSolverOptions(); options.dparam[sn.SICONOS_DPARAM_TOL] = 1e-8; options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = 20000
problem.setMaxSize(3*pairs+10); problem.setKeepLambdaAndYState(True)
grid = sk.TimeDiscretisation(0., %(h)r)
march = sk.TimeStepping(model, grid, scheme, problem); march.initialize(); took, traj = [], []
for k in range(steps):
    t = clock(); march.computeOneStep(); took.append(clock()-t); march.nextStep()
    traj += [np.array(system.q())[:n], np.array(system.velocity())[:n]]
np.concatenate(traj).tofile(folder+"/siconos.traj"); print(json.dumps(dict(step=float(np.median(took[1:])))))
'''


MODES_PEER = r'''
import ctypes, json, sys, time
try: ctypes.CDLL("libmpi.so.40", ctypes.RTLD_GLOBAL).MPI_Init(None, None)  # a MUMPS that was built for MPI wants it
except OSError: pass
import numpy as np, scipy.sparse as sp, scipy.sparse.linalg as sla
folder, near, count = sys.argv[1], float(sys.argv[2]), int(sys.argv[3]); d = np.load(folder + "/all.npz"); mu = %(mu)r
M, C, K, B = (sp.csr_matrix((d[k+"_data"], d[k+"_indices"], d[k+"_indptr"]), tuple(d[k+"_shape"])) for k in "MCKB"); n = M.shape[0]
closed = np.abs(B[0::3] @ d["u"]) < 1e-11
normal, along = B[0::3][closed].indices, B[1::3][closed].indices
free = np.setdiff1d(np.arange(n), normal)
L = sp.csr_matrix((np.full(len(normal), -mu), (along, normal)), (n, n)) + sp.eye(n)  # the rows that the normal reactions do not enter
M, C, K = ((L @ A)[free][:, free].tocsc() for A in (M, C, K)); m = len(free); s = 2j * np.pi * near
start = time.process_time(); Q = (s * s * M + s * C + K).astype(complex).tocsc()
try:
    import mumps; context = mumps.Context(); context.set_matrix(Q); context.factor(); solve, tool = context.solve, "MUMPS"
except ImportError:
    solve, tool = sla.splu(Q, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options=dict(SymmetricMode=True)).solve, "SuperLU"
def operate(x):
    x = np.asarray(x).ravel(); f, g = x[:m], x[m:]; u = solve(-(C @ f + M @ (s * f + g))); return np.concatenate([u, f + s * u])
nu, X = sla.eigs(sla.LinearOperator((2*m, 2*m), matvec=operate, dtype=complex), k=count, which="LM", tol=1e-10, ncv=2*count+5,
                 v0=np.ones(2*m, complex))
value = s + 1 / nu; took = time.process_time() - start
residual = max(np.linalg.norm((l*l*M + l*C + K) @ x[:m]) / np.linalg.norm(K @ x[:m]) for l, x in zip(value, X.T))
print(json.dumps(dict(seconds=took, tool=tool, real=list(value.real), imaginary=list(value.imag), residual=residual)))
'''


# TOAR around i omega wants complex numbers; a slice is told how many pairs it holds.
TOAR_PEER = r'''
import json, sys, time
import petsc4py, slepc4py; petsc4py.init([]); slepc4py.init([])
import numpy as np
from petsc4py import PETSc
from slepc4py import SLEPc
folder, slices = sys.argv[1], int(sys.argv[2])
def load(name):
    raw = np.fromfile(f"{folder}/{name}.petsc", np.uint8); _, rows, columns, entries = raw[:16].view(">i4")
    ends = 16 + 4 * np.array([rows, rows + entries, rows + 3 * entries])
    starts = np.append(0, np.cumsum(raw[16:ends[0]].view(">i4"))).astype("i4")
    values = raw[ends[1]:ends[2]].view(">f8").astype(complex)
    return PETSc.Mat().createAIJ(size=(rows, columns), csr=(starts, raw[ends[0]:ends[1]].view(">i4").astype("i4"), values))
M, C, K = map(load, "MCK"); sizes = np.loadtxt(folder + "/pairs.txt", ndmin=1); top = 1.0001 * sizes.max()
parts = np.array_split(sizes / top, slices); edges = [0, *((a[-1] + b[0]) / 2 for a, b in zip(parts, parts[1:])), 1]
start, found = time.process_time(), 0
M.scale(top * top); C.scale(top)
for low, high, part in zip(edges, edges[1:], parts):
    pep = SLEPc.PEP().create(PETSc.COMM_SELF); pep.setOperators([K, C, M]); pep.setType("toar")
    pep.setTarget(0.5j * (low + high)); pep.setWhichEigenpairs(SLEPc.PEP.Which.TARGET_MAGNITUDE)
    pep.setDimensions(len(part) + 2); pep.setTolerances(1e-11, 200)
    st = pep.getST(); st.setType("sinvert"); ksp = st.getKSP(); ksp.setType("preonly"); pc = ksp.getPC(); pc.setType("lu")
    pc.setFactorSolverType("mumps"); pep.solve()
    values = np.array([pep.getEigenpair(i) for i in range(pep.getConverged())])
    found += int(((abs(values) >= low) & (abs(values) < high) & (values.imag > 0)).sum()); pep.destroy()
print(json.dumps(dict(seconds=time.process_time() - start, found=found)))
'''
