# cpack -G DEB in the build folder makes squeal_VERSION_amd64.deb; tools/packaging/deb does it, and tries the package out.
set(SQUEAL_CONTACT "squeal maintainers <maintainers@squeal.example>" CACHE STRING "maintainer of the Debian package")
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON) # what is packaged is built; tests need not be
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME squeal)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT ${SQUEAL_CONTACT})
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_PRE_BUILD_SCRIPTS ${CMAKE_SOURCE_DIR}/tools/packaging/debian_layout.cmake)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ
    WORLD_EXECUTE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "openmpi-bin, libopenblas0-pthread, python3 (>= 3.11), python3-h5py, python3-matplotlib, \
python3-numpy, python3-pandas, python3-pil, python3-scipy")
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "libjs-chart.js, libjs-three, python3-meshio")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "gmsh, paraview, python3-xarray")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "finite elements for brake squeal")
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION
    "squeal predicts brake squeal and other friction-induced vibration.
One run finds the sliding equilibrium of a finite-element structure, its
unstable modes (complex eigenvalue analysis), and the limit cycle that
is heard. Contact is unilateral and friction is Coulomb's. It runs on one
core or many, and its tools draw, report and compare what runs found.")
include(CPack)
