dnl sorma.m4 -- what configure.ac needs beyond Autoconf's own macros.

dnl SORMA_CXX20: the compiler must take -std=c++20; no GNU extensions, which would define words such as unix.
AC_DEFUN([SORMA_CXX20], [
    AC_CACHE_CHECK([whether $CXX takes C++20], [sorma_cv_cxx20], [
        sorma_saved=$CXXFLAGS
        CXXFLAGS="$CXXFLAGS -std=c++20"
        AC_COMPILE_IFELSE([AC_LANG_PROGRAM([[#include <span>
#include <string_view>]], [[std::string_view v("ab"); return v.starts_with("a") ? 0 : 1;]])],
            [sorma_cv_cxx20=yes], [sorma_cv_cxx20=no])
        CXXFLAGS=$sorma_saved
    ])
    if test "$sorma_cv_cxx20" != yes; then
        AC_MSG_ERROR([SORMA needs a C++20 compiler, g++ 12 or clang++ 14 at least])
    fi
])

dnl SORMA_TCL: reads tclConfig.sh of --with-tcl=DIR, else of the tclsh on the PATH, else of the usual places.
AC_DEFUN([SORMA_TCL], [
    AC_ARG_WITH([tcl],
        [AS_HELP_STRING([--with-tcl=DIR], [folder of tclConfig.sh])],
        [], [with_tcl=])
    AC_ARG_VAR([TCLSH], [the tclsh to build for and to test with])
    AC_MSG_CHECKING([for tclConfig.sh])
    sorma_dirs=$with_tcl
    if test -z "$with_tcl"; then
        for sorma_tclsh in $TCLSH tclsh tclsh8.6 tclsh9.0; do
            sorma_lib=`echo 'puts [[::tcl::pkgconfig get libdir,install]]; puts $tcl_version' | $sorma_tclsh 2>/dev/null`
            test -n "$sorma_lib" || continue
            set -- $sorma_lib
            sorma_dirs="$sorma_dirs $[1]/tcl$[2] $[1]"
        done
        sorma_multi=`$CC -print-multiarch 2>/dev/null`
        sorma_dirs="$sorma_dirs /usr/lib/$sorma_multi/tcl8.6 /usr/lib/$sorma_multi/tcl9.0 /usr/lib/tcl8.6 $prefix/lib /usr/local/lib"
    fi
    TCL_CONFIG=
    for sorma_dir in $sorma_dirs; do
        if test -f "$sorma_dir/tclConfig.sh"; then
            TCL_CONFIG=$sorma_dir/tclConfig.sh
            break
        fi
    done
    if test -z "$TCL_CONFIG"; then
        AC_MSG_RESULT([no])
        AC_MSG_ERROR([no tclConfig.sh in: $sorma_dirs; install tcl8.6-dev or tcl9.0-dev, or give --with-tcl=DIR])
    fi
    AC_MSG_RESULT([$TCL_CONFIG])
    . "$TCL_CONFIG"
    eval "TCL_STUB_LIB_SPEC=\"$TCL_STUB_LIB_SPEC\""
    eval "TCL_LIB_SPEC=\"$TCL_LIB_SPEC\""
    eval "TCL_INCLUDE_SPEC=\"$TCL_INCLUDE_SPEC\""
    AC_SUBST([TCL_STUB_LIB_SPEC])
    AC_SUBST([TCL_LIB_SPEC])
    AC_SUBST([TCL_INCLUDE_SPEC])
    AC_SUBST([TCL_VERSION])
    dnl Tcl's private header, where it is installed: see generic/tcl/commandFrame.c.
    AC_MSG_CHECKING([for tclInt.h])
    TCL_PRIVATE_SPEC=
    sorma_saved=$CPPFLAGS
    for sorma_dir in `echo "$TCL_INCLUDE_SPEC" | sed 's/-I//'`/tcl-private "$TCL_SRC_DIR"; do
        sorma_spec="-DSORMA_TCL_PRIVATE -idirafter $sorma_dir/generic -idirafter $sorma_dir/unix"
        AC_LANG_PUSH([C])
        CPPFLAGS="$sorma_saved $TCL_INCLUDE_SPEC $sorma_spec"
        AC_COMPILE_IFELSE([AC_LANG_PROGRAM([[#include <tcl.h>
#include <tclInt.h>]], [[static Interp *i; return i->cmdFramePtr->framePtr != 0;]])], [TCL_PRIVATE_SPEC=$sorma_spec])
        AC_LANG_POP([C])
        test -z "$TCL_PRIVATE_SPEC" || break
    done
    CPPFLAGS=$sorma_saved
    AC_MSG_RESULT([${TCL_PRIVATE_SPEC:-no}])
    AC_SUBST([TCL_PRIVATE_SPEC])
    AM_CONDITIONAL([TCL9], [test "$TCL_MAJOR_VERSION" -ge 9])
    AC_PATH_PROGS([TCLSH], [tclsh$TCL_VERSION tclsh], [], [$TCL_EXEC_PREFIX/bin:$PATH])
    if test -z "$TCLSH"; then
        AC_MSG_ERROR([no tclsh$TCL_VERSION found; install tcl$TCL_VERSION])
    fi
])
