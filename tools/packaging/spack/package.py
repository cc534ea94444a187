# Goes to packages/squeal/package.py of a Spack repository; tools/packaging/archive writes it with version and checksum.
from spack_repo.builtin.build_systems.cmake import CMakePackage

from spack.package import *


class Squeal(CMakePackage):
    """Finite elements for brake squeal: sliding equilibrium, complex modes, and the limit cycle that is heard."""

    url = "@URL@/squeal-@VERSION@.tar.gz"

    license("GPL-3.0-or-later")

    version("@VERSION@", sha256="@SHA256@")

    variant("gmsh", default=True, description="Read meshes and geometries; without it matrix and point scenes still run")
    variant("tools", default=True, description="Python modules of the tools that draw and report")

    depends_on("c", type="build")
    depends_on("cxx", type="build")
    depends_on("cmake@3.20:", type="build")
    depends_on("pkgconfig", type="build")
    depends_on("mpi")
    depends_on("petsc@3.18: +double ~complex +mpi +mumps +hdf5")
    depends_on("slepc@3.18:")
    depends_on("mumps +mpi +double")
    depends_on("metis@5:")
    depends_on("hdf5 +mpi")
    depends_on("openblas threads=none")
    depends_on("eigen@3.4:3")
    depends_on("boost@1.74:")
    depends_on("nlohmann-json@3.11:")
    depends_on("tomlplusplus@3.3:")
    depends_on("gmsh@4.8: +opencascade ~fltk", when="+gmsh")
    depends_on("libseccomp", when="+gmsh")
    with when("+tools"):
        depends_on("python@3.11:", type="run")
        depends_on("py-h5py", type="run")
        depends_on("py-matplotlib", type="run")
        depends_on("py-numpy", type="run")
        depends_on("py-pandas", type="run")
        depends_on("py-scipy", type="run")

    conflicts("platform=darwin", msg="the mesher's sandbox is Linux's")
    conflicts("%gcc@:11", msg="squeal is C++20")

    def cmake_args(self):
        return [
            self.define_from_variant("SQUEAL_GMSH", "gmsh"),
            self.define("BUILD_TESTING", False),
            self.define("LAPACKE_LIBRARY", self.spec["openblas"].libs[0]),  # OpenBLAS has LAPACKE in it
        ]

    def setup_run_environment(self, env):
        env.prepend_path("PYTHONPATH", self.prefix.share.squeal.tools)
        env.set("OPENBLAS_NUM_THREADS", "1")

    @run_after("install")
    @on_package_attributes(run_tests=True)
    def check_version(self):
        Executable(self.prefix.bin.squeal)("--version")
