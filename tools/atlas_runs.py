"""What the pictures of tools/atlas share: runs of squeal that are kept, scenes of matrices, files."""

import hashlib
from concurrent.futures import ThreadPoolExecutor

from squeal import common

common.needs("h5py", "matplotlib", "numpy")
import h5py
import squeal

ROOT = common.ROOT
OSCILLATOR = ROOT / "inputs" / "oscillator" / "scene.toml"
PIN = ROOT / "inputs" / "pin_on_disc" / "scene.toml"
plt = common.pyplot(font_size=9)


class Run:
    """A finished run of squeal: its report, its histories, its exit code."""

    def __init__(self, folder, code):
        self.folder, self.code = folder, code
        self.report = squeal.read_report(folder)

    def __getitem__(self, stage):
        return self.report[stage]

    def history(self, name, group="transient"):
        with h5py.File(self.folder / "history.h5") as file:
            return file[f"{group}/{name}"][()]


def run(results, scene, *arguments, **values):
    """squeal on a scene; values are its keys with __ for a dot. A run made before with the same arguments is reused."""
    values = {key.replace("__", "."): value for key, value in values.items()}
    words = [str(scene), *map(str, arguments), *(f"{key}={value}" for key, value in values.items())]
    folder = results / "runs" / hashlib.sha1(" ".join(words).encode()).hexdigest()[:16]
    code = folder / "exit_code"
    if not code.exists():
        folder.mkdir(parents=True, exist_ok=True)
        code.write_text(str(squeal.run(scene, values, options=arguments, output=folder).exit_code))
    return Run(folder, int(code.read_text()))


def runs(results, jobs):
    """Many runs, two at a time; a job is the arguments of run() as (scene, [arguments], {values})."""
    with ThreadPoolExecutor(max_workers=2) as pool:
        return list(pool.map(lambda job: run(results, job[0], *job[1], **job[2]), jobs))


def matrix_scene(folder, M, C, K, B, F, gap, drive, friction=0.0, start=None, probes=(), more=""):
    """A scene of its own: matrices in a folder, a start state (u, v), probes as degrees of freedom."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, value in dict(M=M, C=C, K=K, B=B, F=F, gap=gap, drive=drive).items():
        common.write_petsc(folder / f"{name}.petsc", value)
    text = f'[matrices]\nfolder = "."\n[friction]\ncoefficient = {friction}\n[transient]\nenabled = true\n'
    if start is not None:
        common.write_petsc(folder / "start.state", *start)
        text += 'start = "start.state"\n'
    text += "".join(f'[[probe]]\nname = "p{dof}"\non = "dof:{dof}"\n' for dof in probes) + more
    (folder / "scene.toml").write_text(text)
    return folder / "scene.toml"


def save(results, name, figure):
    file = results / f"{name}.png"
    common.save_small(figure, file)
    plt.close(figure)
    print(file)
