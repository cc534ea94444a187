# Run by cpack on the staged files: what Debian's policy asks of an installation.
set(usr ${CPACK_TEMPORARY_DIRECTORY}/usr)
set(doc ${usr}/share/doc/squeal)
set(packaging ${CMAKE_CURRENT_LIST_DIR})

# Licence and changes have names of their own; libraries are found without a path.
file(REMOVE ${doc}/LICENSE)
file(COPY_FILE ${packaging}/copyright ${doc}/copyright)
string(TIMESTAMP now "%a, %d %b %Y %H:%M:%S +0000" UTC) # of SOURCE_DATE_EPOCH where it is set
file(WRITE ${doc}/changelog "squeal (${CPACK_PACKAGE_VERSION}) unstable; urgency=medium

  * CHANGELOG.md beside this file says what is new.

 -- ${CPACK_PACKAGE_CONTACT}  ${now}
")
execute_process(COMMAND gzip -9n ${doc}/changelog COMMAND_ERROR_IS_FATAL ANY)
foreach(program squeal squeal_mesher)
  if(EXISTS ${usr}/bin/${program})
    file(RPATH_REMOVE FILE ${usr}/bin/${program})
  endif()
endforeach()

# Debian's own interpreters, whatever else PATH has.
file(GLOB tools LIST_DIRECTORIES false ${usr}/share/squeal/tools/*)
execute_process(COMMAND sed -i -e "1s|^#!/usr/bin/env python3|#!/usr/bin/python3|" -e "1s|^#!/usr/bin/env bash|#!/bin/bash|" ${tools}
                COMMAND_ERROR_IS_FATAL ANY)

# import squeal
file(MAKE_DIRECTORY ${usr}/lib/python3/dist-packages)
file(CREATE_LINK ../../../share/squeal/tools/squeal ${usr}/lib/python3/dist-packages/squeal SYMBOLIC)

# One manual page of both programs.
set(manuals ${usr}/share/man/man1)
file(COPY ${packaging}/squeal.1 DESTINATION ${manuals} FILE_PERMISSIONS OWNER_READ OWNER_WRITE GROUP_READ WORLD_READ)
execute_process(COMMAND gzip -9n ${manuals}/squeal.1 COMMAND_ERROR_IS_FATAL ANY)
if(EXISTS ${usr}/bin/squeal_mesher)
  file(CREATE_LINK squeal.1.gz ${manuals}/squeal_mesher.1.gz SYMBOLIC)
endif()
