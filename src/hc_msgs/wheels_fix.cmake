# Injected with -DCMAKE_PROJECT_hc_msgs_INCLUDE by wheels_backend.py, only when building against
# the ROS wheels. Four things that plain ament has no need of:
# 1. The wheels' imported targets name include folders of the machine that built them
#    (/opt/python/...), which CMake refuses where they do not exist: drop those.
# 2. HC_SOURCE_FOLDERS: install a .pth file with them, which makes an editable install.
# 3. The run configurations and parameter files, which hc_bringup's setup.py installs for colcon.
# 4. HC_COMMIT: install a file with it, so that `hc --version` of a wheel can say where it is from.
function(_hc_drop_missing_include_folders)
  get_property(_targets DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(_target IN LISTS _targets)
    get_target_property(_folders ${_target} INTERFACE_INCLUDE_DIRECTORIES)
    if(_folders)
      set(_kept)
      foreach(_folder IN LISTS _folders)
        if(_folder MATCHES "\\$<" OR EXISTS "${_folder}")
          list(APPEND _kept "${_folder}")
        endif()
      endforeach()
      set_target_properties(${_target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${_kept}")
    endif()
  endforeach()
endfunction()
cmake_language(DEFER CALL _hc_drop_missing_include_folders)

if(HC_SOURCE_FOLDERS)
  list(JOIN HC_SOURCE_FOLDERS "\n" _hc_lines)
  file(WRITE "${CMAKE_BINARY_DIR}/hc_suite_source.pth" "${_hc_lines}\n")
  install(FILES "${CMAKE_BINARY_DIR}/hc_suite_source.pth" DESTINATION "${PYTHON_INSTALL_DIR}")
endif()

if(HC_COMMIT)
  file(WRITE "${CMAKE_BINARY_DIR}/commit.txt" "${HC_COMMIT}\n")
  install(FILES "${CMAKE_BINARY_DIR}/commit.txt" DESTINATION "${PYTHON_INSTALL_DIR}/hc_bringup")
endif()

file(GLOB _hc_configurations "${CMAKE_CURRENT_LIST_DIR}/../../config/*.yaml")
install(FILES ${_hc_configurations} DESTINATION share/hc_bringup/config)
file(GLOB _hc_layouts "${CMAKE_CURRENT_LIST_DIR}/../../config/layouts/*")
install(FILES ${_hc_layouts} DESTINATION share/hc_bringup/config/layouts)
file(GLOB _hc_robots "${CMAKE_CURRENT_LIST_DIR}/../../config/robots/*.yaml")
install(FILES ${_hc_robots} DESTINATION share/hc_bringup/config/robots)

# A wheel is the same wherever it is built: the folder of the build, which has a random name, and
# that of the sources are not compiled in.
add_compile_options(
  "-ffile-prefix-map=${CMAKE_BINARY_DIR}=build"
  "-ffile-prefix-map=${CMAKE_SOURCE_DIR}=hc_msgs")
# The identity that a linker gives its output is a hash of it while it still names that folder.
add_link_options("-Wl,--build-id=none")
