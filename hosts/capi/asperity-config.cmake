# The imported target asperity::asperity.
get_filename_component(asperity_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
add_library(asperity::asperity SHARED IMPORTED)
set_target_properties(asperity::asperity PROPERTIES
    IMPORTED_LOCATION "${asperity_prefix}/lib/libasperity${CMAKE_SHARED_LIBRARY_SUFFIX}"
    INTERFACE_INCLUDE_DIRECTORIES "${asperity_prefix}/include")
