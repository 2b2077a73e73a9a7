#include "rows.h"

#include <sorma.h>

#ifdef HAVE_CURL
#include "etcdDirectory.h"
#endif

namespace directory {

void addRows() {
    sorma::Directory::add("local", local);
#ifdef HAVE_CURL
    sorma::Directory::add("etcd", etcd::row);
#endif
    sorma::Directory::steps = where;
}

}  // namespace directory
