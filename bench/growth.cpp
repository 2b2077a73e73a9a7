#include "rows.h"
namespace bench { void growth(Table&) {} }
