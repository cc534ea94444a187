"""Contact laws and the mass at the contact: marches of small chains, and the pictures of tools/atlas made from them."""

from squeal import common

common.needs("matplotlib", "numpy")
import numpy as np
from atlas_runs import PIN, matrix_scene, plt, run, runs, save
from squeal.common import BLUE, GREEN, ORANGE, RED

LAWS = {"modified": (BLUE, "o", "at u + h/2 v (squeal)"), "velocity": (GREEN, "s", "on velocities"), "end": (RED, "^", "at u+"),
        "start": (ORANGE, "v", "at u")}


class Chain:
    """Masses in a row above a rigid ground, no friction, one contact below the first: what each law makes of it."""

    def __init__(self, M, K, F, gap, u, v):
        self.M, self.K, self.F, self.gap = np.atleast_2d(M), np.atleast_2d(K), np.atleast_1d(F), gap
        self.u, self.v = np.array(u, float), np.array(v, float)

    def march(self, law, h, steps):
        """theta = 1/2 with Signorini's law where `law` has it: gap below, reaction and energy at the ends of the steps."""
        A = self.M + h**2 / 4 * self.K
        inverse = np.linalg.inv(A)
        W, u, v, rows = h * inverse[0, 0], self.u.copy(), self.v.copy(), []
        for _ in range(steps):
            free = inverse @ (A @ v - h**2 / 2 * self.K @ v - h * self.K @ u + h * self.F)
            if law == "velocity":
                rate = free[0] if self.gap + u[0] + h / 2 * v[0] <= 1e-12 else np.inf
            elif law == "end":
                rate = free[0] + v[0] + 2 * (self.gap + u[0]) / h
            else:
                rate = free[0] + (self.gap + u[0]) / h + (v[0] / 2 if law == "modified" else 0)
            reaction = max(0.0, -rate / W)
            after = free + h * reaction * inverse[:, 0]
            u, v = u + h / 2 * (v + after), after
            rows.append((self.gap + u[0], reaction, v @ self.M @ v / 2 + u @ self.K @ u / 2 - self.F @ u))
        return np.array(rows).T

    def squeal(self, results, h, steps, name):
        """The same from a run of squeal."""
        n = len(self.u)
        scene = matrix_scene(results / name, self.M, np.zeros((n, n)), self.K, np.eye(2, n) * [[1], [0]], self.F, [self.gap],
                             [1], start=(self.u, self.v), probes=(0,), more="[modes]\nband = 1\nmethod = 'full'\n")
        done = run(results, scene, transient__steps=steps, transient__step_size=h)
        return self.gap + done.history("probes/p0"), done.history("normal_force"), done


def falling_mass(drop=1.0):
    return Chain(2.0, 0.0, -2 * 9.81, drop, [0], [0])


def bouncing_bar(elements, contact_mass=1.0):
    """Doyen, Ern, Piperno 2011: dropped from 5, waves of speed 30, period 16/3; `contact_mass` of the end node's own."""
    length = 10 / elements
    K = (2 * np.eye(elements + 1) - np.eye(elements + 1, k=1) - np.eye(elements + 1, k=-1)) * 900 / length
    K[0, 0] = K[-1, -1] = 900 / length
    mass = np.full(elements + 1, length)
    mass[[0, -1]] /= 2
    moved = (1 - contact_mass) * mass[0]  # to the next node: the mass stays, the centre moves by a part of an element
    mass[[0, 1]] += [-moved, moved]
    return Chain(np.diag(mass), K, -10 * mass, 5.0, np.zeros(elements + 1), np.zeros(elements + 1))


def spurious_motion(law, h):
    """Largest height and depth of the falling mass long after its impact, over eight phases of the impact in its step."""
    worst = 0
    for phase in range(8):
        mass = falling_mass(1 + 9.81 * 0.45 * h * phase / 8)
        gap = mass.march(law, h, int(0.9 / h))[0]
        worst = max(worst, np.abs(gap[int(0.6 / h):]).max())
    return worst


def contact_law(results):
    """Signorini's law at four places of the step: what is left of an impact, energy of a bouncing bar, its reaction."""
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(14, 4.4))
    sizes = 0.02 / 2.0 ** np.arange(6)
    for law, (colour, marker, label) in LAWS.items():
        left.loglog(sizes, [max(spurious_motion(law, h), 1e-16) for h in sizes], marker + "-", color=colour, label=label)
        if law == "modified":
            for h in sizes[::2]:
                gap, _, _ = falling_mass().squeal(results, h, int(0.9 / h), "falling_mass")
                left.loglog(h, max(np.abs(gap[int(0.6 / h):]).max(), 1e-16), "o", mfc="none", mec="black", ms=11)
    left.plot([], [], "o", mfc="none", mec="black", ms=11, label="runs of squeal")
    left.set(xlabel="time step h [s]", ylabel="motion left after an inelastic impact [m]", ylim=(1e-17, 1e6),
             title="Falling mass: it should lie still")
    left.legend(fontsize=8, loc="upper left")

    elements = 50
    h = 1 / (10 * elements)
    bar = bouncing_bar(elements)
    steps = int(32 / h)
    time = h * np.arange(1, steps + 1)
    for law, (colour, marker, label) in LAWS.items():
        gap, reaction, energy = bar.march(law, h, steps)
        middle.plot(time[::50], energy[::50] / 500, color=colour, label=label)
        if law in ("modified", "end", "velocity"):
            now = (time > 0.95) & (time < 1.75)
            right.plot(time[now], reaction[now], color=colour, lw=0.8, zorder={"end": 1, "velocity": 2}.get(law, 3),
                       label=label)
    middle.axhline(0, color="black", ls=":", label="exact")
    middle.set(xlabel="time [s], an impact every 16/3", ylabel="energy / energy of the fall", ylim=(-0.6, 0.4),
               title=f"Bouncing bar of {elements} elements: energy")
    middle.legend(fontsize=8, loc="lower left")
    right.plot([1, 1, 5 / 3, 5 / 3], [0, 300, 500, 0], "k:", label="exact", zorder=4)
    right.set(xlabel="time [s]", ylabel="reaction [N]", ylim=(-50, 1600), title="The same: reaction of the first impact")
    right.legend(fontsize=8, loc="upper right")
    save(results, "contact_law", figure)


def bar_reaction(elements, courant, contact_mass, law="modified"):
    """Energy lost in the bar's first impact [J], and noise of its reaction: rms error over 1.1 to 1.6 s, relative."""
    h = courant / (3 * elements)  # courant: wave speed times h over an element
    bar = bouncing_bar(elements, contact_mass)
    _, reaction, energy = bar.march(law, h, int(3 / h))
    time = h * np.arange(1, len(reaction) + 1)
    window = (time > 1.1) & (time < 1.6)
    exact = 300 + 300 * (time[window] - 1)
    return -energy[-1], np.sqrt(np.mean((reaction[window] - exact) ** 2)) / 400


def contact_mass(results):
    """Mass at the contact node: energy lost in an impact and noise of the reaction, on the bar and on the pin."""
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(14, 4.4))
    meshes = [12, 25, 50, 100, 200]
    for share, colour, marker in ((1, BLUE, "o"), (0.5, ORANGE, "s"), (0.1, GREEN, "^"), (0, RED, "v")):
        label = {1: "as meshed", 0: "massless"}.get(share, f"{share:g} of it, the rest to the next node")
        found = np.array([bar_reaction(n, 0.3, share) for n in meshes])
        left.loglog(meshes, np.abs(found[:, 0]), marker + "-", color=colour, label=label)
        steps = [0.05, 0.1, 0.2, 0.4, 0.8, 1.6]
        noise = [bar_reaction(50, courant, share)[1] for courant in steps]
        middle.loglog(steps, noise, marker + "-", color=colour, label=label)
    for n, share in ((25, 1), (50, 1), (25, 0), (50, 0)):
        h = 0.3 / (3 * n)
        _, _, done = bouncing_bar(n, share).squeal(results, h, int(3 / h), f"bar_{n}_{share}")
        left.plot(n, -done.history("contact_power").sum() * h, "o", mfc="none", mec="black", ms=11,
                  label="runs of squeal" if (n, share) == (25, 1) else None)
    left.set(xlabel="elements of the bar", ylabel="energy lost in the impact [J] of 500", title="Energy: falls as 1/elements")
    middle.set(xlabel="wave speed x h / element", ylabel="noise of the reaction, rms / mean",
               title="Bar of 50 elements: noise of the reaction")
    left.legend(fontsize=8)
    divisions, periods = [2, 3, 4, 6], [30, 60, 120, 240]
    jobs = [(PIN, [], dict(mesh__parameters__divisions=d, damping__beta=3e-7, cycle__enabled="false", modes__method="full",
                           transient__enabled="true", transient__start="estimate", transient__periods=4,
                           transient__steps_per_period=n)) for d in divisions for n in periods]
    done = runs(results, jobs)
    for k, d in enumerate(divisions):
        rough = []
        for r in done[k * len(periods):(k + 1) * len(periods)]:
            force = r.history("normal_force")
            force = force[len(force) // 2:]
            rough.append(np.sqrt(np.mean(np.diff(force, 2) ** 2)) / 4 / force.mean())  # 1: it alternates by its mean
        right.loglog(periods, rough, "o-", color=plt.cm.viridis(k / 4), label=f"{d} divisions, {done[k * len(periods)]['model']['pairs']} pairs")
    right.set(xlabel="steps a period", ylabel="force that alternates from step to step / mean", title="Pin, as meshed, vibrating with lift-off")
    right.legend(fontsize=8, loc=(0.02, 0.3))
    for axes, ticks in ((left, meshes), (right, periods)):
        axes.minorticks_off()
        axes.set_xticks(ticks)
        axes.set_xticklabels(ticks)
    save(results, "contact_mass", figure)
