"""Random frictional systems, and their motion by events (events.cpp), for random_systems.py."""

import ctypes
import itertools
import os
import subprocess
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent


def unit(random, size, entries):
    vector = np.zeros(size)
    vector[random.choice(size, min(entries, size), replace=False)] = random.normal(size=min(entries, size))
    return vector / np.linalg.norm(vector)


def draw(random):
    n = int(random.integers(2, 11))
    m = int(random.integers(1, min(3, n // 2) + 1))
    mass, stiffness = np.exp(random.uniform(-1, 1, n)), np.exp(random.uniform(-1, 1.5, n))
    K = np.diag(stiffness)
    for _ in range(n):
        a, row = np.exp(random.uniform(-2, 0.7)), unit(random, n, 2)
        K += a * np.outer(row, row)
    C = random.uniform(0.001, 0.02) * np.diag(mass) + random.uniform(0.001, 0.02) * K
    Bn = np.array([unit(random, n, int(random.integers(1, 4))) for _ in range(m)])
    Bt = np.array([unit(random, n, int(random.integers(1, 4))) for _ in range(m)])
    Bt -= np.sum(Bt * Bn, 1)[:, None] * Bn
    if min(np.linalg.norm(Bt, axis=1)) < 0.3 or (m > 1 and np.linalg.svd(np.vstack([Bn, Bt]))[1][-1] < 0.1):
        return None
    Bt /= np.linalg.norm(Bt, axis=1)[:, None]
    gap = np.where(random.random(m) < 0.6, 0.0, random.uniform(0, 0.6, m))
    F = 0.4 * random.normal(size=n) - Bn.T @ random.uniform(0.3, 2, m)
    drive = random.uniform(0.2, 2.0, m) * random.choice([-1, 1], m)
    kinetic, decay, rest = random.uniform(0.15, 0.9), 1.0, 0.0
    rest = kinetic
    if random.random() < 0.5:
        rest, decay = kinetic * random.uniform(1.05, 1.7), random.uniform(0.2, 1.5)
    return dict(M=np.diag(mass), C=C, K=K, Bn=Bn, Bt=Bt, gap=gap, drive=drive, F=F, kinetic=kinetic, rest=rest, decay=decay)


def mu(s, speed):
    return s["kinetic"] + (s["rest"] - s["kinetic"]) * np.exp(-abs(speed) / s["decay"])


def well_posed(s):
    """Sliding and sticking have one solution whatever pairs are closed and whichever way they slide: minors of the masses stay positive."""
    m = len(s["gap"])
    B = np.vstack([s["Bn"], s["Bt"]])
    W = B @ np.linalg.solve(s["M"], B.T)
    nn, nt = W[:m, :m], W[:m, m:]
    for ways in itertools.product([-1, 1], repeat=m):
        A = nn - s["rest"] * nt * np.array(ways)
        for size in range(1, m + 1):
            for of in itertools.combinations(range(m), size):
                of = list(of)
                if np.linalg.det(A[np.ix_(of, of)]) < 0.1 * np.linalg.det(nn[np.ix_(of, of)]):
                    return False
    return True


def equilibria(s):
    m, found = len(s["gap"]), []
    K = s["K"]
    direction = np.sign(s["drive"]) * mu(s, s["drive"])  # r_t = mu r_n e
    for closed in itertools.product([0, 1], repeat=m):
        of = [i for i in range(m) if closed[i]]
        H = (s["Bn"] + direction[:, None] * s["Bt"])[of]
        A = np.block([[K, -H.T], [s["Bn"][of], np.zeros((len(of), len(of)))]])
        x = np.linalg.solve(A, np.concatenate([s["F"], -s["gap"][of]]))
        u, r = x[:len(K)], x[len(K):]
        gaps = s["gap"] + s["Bn"] @ u
        slack = min([*r, *(gaps[i] for i in range(m) if not closed[i])])
        if slack > -1e-9:
            found.append((u, of, r, slack))
    return found


def growth(s, u0, of, r):
    """Eigenvalues and vectors (u, v) of small motions with the closed pairs sliding."""
    n = len(s["K"])
    e = np.sign(s["drive"])
    C = s["C"].copy()
    for i, force in zip(of, r):
        slope = -(s["rest"] - s["kinetic"]) / s["decay"] * np.exp(-abs(s["drive"][i]) / s["decay"])
        C += slope * force * np.outer(s["Bt"][i], s["Bt"][i])
    H = (s["Bn"] + (e * mu(s, s["drive"]))[:, None] * s["Bt"])[of]
    Z = np.linalg.svd(s["Bn"][of])[2][len(of):].T if of else np.eye(n)
    Y = np.linalg.svd(H)[2][len(of):].T if of else np.eye(n)
    M, C, K = (Y.T @ A @ Z for A in (s["M"], C, s["K"]))
    k = len(M)
    values, vectors = np.linalg.eig(np.block([[np.zeros((k, k)), np.eye(k)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]]))
    return values, np.vstack([Z @ vectors[:k], Z @ vectors[k:]])


def system(seed, number):
    """The system of a number, its equilibrium and its growing eigenvalues; most of them grow."""
    random = np.random.default_rng([seed, number])
    stable_too = random.random() < 0.08
    while True:
        s = draw(random)
        if s is None or not well_posed(s):
            continue
        found = equilibria(s)
        if len(found) != 1 or found[0][3] < 0.02 or not found[0][1]:
            continue
        u0, of, r, _ = found[0]
        values, vectors = growth(s, u0, of, r)
        ratio = max(values.real / np.maximum(abs(values), 1e-9))
        if (ratio < -1e-3 and stable_too) or (1e-3 < ratio < 0.3 and all(abs(values[values.real > 0].imag) > 0.05)):
            return s, u0, of, values, vectors, random


def compiled(folder):
    """The library of events.cpp, compiled in the folder."""
    shared = folder / "events.so"
    sources = [HERE / "events.cpp", HERE / "events.hpp"]
    if not shared.exists() or shared.stat().st_mtime < max(file.stat().st_mtime for file in sources):
        subprocess.run([os.environ.get("CXX", "g++"), "-O2", "-march=native", "-DNDEBUG", "-shared", "-fPIC", "-I/usr/include/eigen3",
                        "-o", shared, sources[0]], check=True)
    library = ctypes.CDLL(str(shared.resolve()))
    library.make_system.restype = ctypes.c_void_p
    return library


# --- reference ---------------------------------------------------------------------------------------------------------------------


class Reference:
    def __init__(self, library, s, u0, values):
        self.library, self.n, self.m = library, len(u0), len(s["gap"])
        self.s, self.rest = s, np.concatenate([u0, np.zeros(len(u0))])
        fastest = np.sqrt(max(np.linalg.eigvals(np.linalg.solve(s["M"], s["K"])).real))
        self.longest = 2 * np.pi / fastest / 20
        force = np.linalg.norm(s["F"])
        speed = max(abs(s["drive"]))
        scales = np.array([speed / fastest, speed, force, force / max(np.diag(s["M"]))])
        arrays = [np.ascontiguousarray(a, float) for a in (s["M"], s["C"], s["K"], s["Bn"], s["Bt"], s["F"], s["gap"], s["drive"], u0,
                                                         [s["kinetic"], s["rest"], s["decay"]], scales)]
        self.pointer = ctypes.c_void_p(library.make_system(self.n, self.m, *[a.ctypes.data_as(ctypes.c_void_p) for a in arrays]))
        self.scale = np.concatenate([np.full(self.n, scales[0]), np.full(self.n, speed)])

    def __del__(self):
        self.library.free_system(self.pointer)

    def flow(self, x, length, statuses=None, samples=0, relative=1e-11):
        """End, statuses there, samples, sums. Raises ArithmeticError where no status is consistent."""
        x = np.array(x, float)
        status = np.array(statuses if statuses is not None else [-1] * self.m, np.int32)
        rows, sums = np.zeros((max(samples, 1), 2 * self.n)), np.zeros(5)
        c = lambda a: a.ctypes.data_as(ctypes.c_void_p)
        code = self.library.integrate(self.pointer, c(x), ctypes.c_double(length), c(status), ctypes.c_double(relative),
                                      ctypes.c_double(self.longest), samples, c(rows), c(sums))
        if code:
            raise ArithmeticError(["", "no status is consistent", "events pile up"][code])
        return x, status, rows[:samples], sums

    def size(self, x):
        d = x - self.rest
        u, v = d[..., :self.n], d[..., self.n:]
        return np.sqrt(np.einsum("...i,ij,...j", u, self.s["K"], u) + np.einsum("...i,ij,...j", v, self.s["M"], v))

    def distance(self, x, y):
        return self.size(x - y + self.rest)

    def jacobian(self, x, T, statuses, eps=1e-6):
        columns = []
        for j in range(2 * self.n):
            d = np.zeros(2 * self.n)
            d[j] = eps * self.scale[j]
            plus, minus = (self.flow(x + sign * d, T, statuses)[0] for sign in (1, -1))
            columns.append((plus - minus) / (2 * d[j]))
        return np.array(columns).T

    def quiet_phase(self, x, T):
        """A state of the motion in the middle of the longest time without an event."""
        status, times, y = None, [], np.array(x)
        changes = [0]
        for k in range(100):
            y, new, _, sums = self.flow(y, T / 100, status)
            if sums[3] > 0:
                changes.append(k + 0.5)
            status = new
        if len(changes) == 1:
            return self.flow(x, T / 2)[:2]
        gaps = np.diff(changes + [changes[1] + 100])
        k = int(np.argmax(gaps[1:])) + 1
        return self.flow(x, T / 100 * ((changes + [changes[1] + 100])[k] + gaps[k] / 2))[:2]

    def cycle(self, x, T):
        """Newton's method on Phi_T(x) - x from x: state, statuses, period, mean energy, multipliers with the shift's taken out, their noise."""
        x, statuses = self.quiet_phase(x, T)
        residual = []
        for _ in range(12):
            end, ends, _, _ = self.flow(x, T, statuses)
            residual.append(self.distance(end, x) / self.size(x))
            if residual[-1] < 1e-9 or (len(residual) > 3 and residual[-1] > 0.5 * residual[-3] and residual[-1] < 3e-8):
                break
            h = 1e-6 * T
            f = (self.flow(x, T + h, statuses)[0] - end) / h
            J = self.jacobian(x, T, statuses) - np.eye(2 * self.n)
            w = f / self.scale**2
            A = np.block([[J * self.scale, f[:, None]], [(w * self.scale)[None, :], np.zeros((1, 1))]])
            step = np.linalg.lstsq(A, np.concatenate([x - end, [0]]), rcond=1e-9)[0]
            part = min(1.0, 0.3 * self.size(x) / max(self.distance(x + step[:-1] * self.scale, x), 1e-300), 0.2 * T / max(abs(step[-1]), 1e-300))
            x, T = x + part * step[:-1] * self.scale, T + part * step[-1]
            x = self.flow(x, 0.0, statuses)[0]
        else:
            raise ArithmeticError(f"Newton's method ends at {residual[-1]:.1e}")
        _, _, _, sums = self.flow(x, T, statuses)
        values = []
        for eps in (1e-6, 1e-5):
            m = np.linalg.eigvals(self.jacobian(x, T, statuses, eps))
            m = m[np.argsort(-abs(m))]
            values.append(m)
        trivial = np.argmin(abs(values[0] - 1))
        other = np.argmin(abs(values[1] - 1))
        left = [np.delete(values[0], trivial), np.delete(values[1], other)]
        return dict(state=x, statuses=statuses, period=T, energy=sums[0] / T, multipliers=left[0], moved=residual[0],
                    noise=max(abs(abs(left[0][0]) - abs(left[1][0])), abs(values[0][trivial] - 1)))

    def motion(self, x, period, periods, discard):
        """Where x leads: closing lag, exponent, mean energy with its bar."""
        status, energies = None, []
        x, status, _, _ = self.flow(x, period * discard, status, relative=1e-7)
        for _ in range(periods):
            x, status, _, sums = self.flow(x, period, status, relative=1e-9)
            energies.append(sums[0] / period)
        energies = np.array(energies)
        _, _, rows, _ = self.flow(x, 24 * period, status, 24 * 200, relative=1e-9)
        size = np.mean(self.size(rows))
        lags = [np.mean(self.distance(rows[lag:lag + 2000:20], rows[:2000:20])) / size for lag in range(40, 2800)]
        lag = 40 + int(np.argmin(lags))
        first = next((40 + i for i, d in enumerate(lags) if d < 1.5 * min(lags) + 0.02), lag)
        batches = energies[len(energies) % 16:].reshape(16, -1).mean(1)
        bar = 2.13 * batches.std(ddof=1) / 4
        half = len(energies) // 2
        return dict(state=x, statuses=status, closes=first * period / 200, misses=min(lags), energy=energies.mean(), bar=bar,
                    drift=energies[half:].mean() - energies[:half].mean(), spread=energies[half:].std() / energies.mean(),
                    earlier=energies[:half // 2].std() / energies.mean())

    def exponent(self, x, period, periods=400):
        """Growth of neighbours a period, with its bar: the largest but for the flow's."""
        y = self.flow(x, 0.0)[0]
        d = np.random.default_rng(1).normal(size=2 * self.n) * self.scale
        logs = []
        status = None
        for _ in range(periods):
            a = 1e-7 * self.size(y) / self.size(d + self.rest)
            end, status_end, _, _ = self.flow(y, period, status, relative=1e-11)
            beside = self.flow(y + a * d, period, status, relative=1e-11)[0]
            d, y, status = (beside - end) / a, end, status_end
            size = self.size(d + self.rest)
            logs.append(np.log(max(size, 1e-300) / self.size(y)))
            d *= self.size(y) / size
        logs = np.array(logs[periods // 6:])
        batches = logs[len(logs) % 10:].reshape(10, -1).mean(1)
        return logs.mean(), 2.26 * batches.std(ddof=1) / np.sqrt(10)
