# Run by cpack on the staged files: what Debian's policy asks of an installation.
set(usr ${CPACK_TEMPORARY_DIRECTORY}/usr)
set(doc ${usr}/share/doc/squeal)
set(packaging ${CMAKE_CURRENT_LIST_DIR})

# Licence and changes have names of their own; libraries are found without a path.
file(REMOVE ${doc}/LICENSE)
file(COPY_FILE ${packaging}/copyright ${doc}/copyright)
execute_process(COMMAND gzip -9n ${doc}/CHANGELOG.md COMMAND_ERROR_IS_FATAL ANY)
file(RENAME ${doc}/CHANGELOG.md.gz ${doc}/changelog.gz)
foreach(program squeal squeal_mesher)
  if(EXISTS ${usr}/bin/${program})
    file(RPATH_REMOVE FILE ${usr}/bin/${program})
  endif()
endforeach()

# Debian's own interpreters, whatever else PATH has.
file(GLOB tools ${usr}/share/squeal/tools/*)
foreach(tool ${tools})
  if(NOT IS_DIRECTORY ${tool})
    file(READ ${tool} text)
    string(REGEX REPLACE "^#!/usr/bin/env (python3|bash)" "#!/usr/bin/\\1" new "${text}")
    if(NOT new STREQUAL text)
      execute_process(COMMAND sed -i "1s|^#!/usr/bin/env |#!/usr/bin/|" ${tool} COMMAND_ERROR_IS_FATAL ANY)
    endif()
  endif()
endforeach()

# import squeal
file(MAKE_DIRECTORY ${usr}/lib/python3/dist-packages)
file(CREATE_LINK ../../../share/squeal/tools/squeal ${usr}/lib/python3/dist-packages/squeal SYMBOLIC)
