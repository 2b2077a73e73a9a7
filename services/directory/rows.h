// rows.h -- the rows of comm/directory.h, and what explains them. They are loaded when a program first asks for a directory, since most never do.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "comm/comm.h"
#include "comm/directory.h"

namespace directory {

std::unique_ptr<sorma::Directory> local(sorma::Sorm& sorm, sorma::Loop& loop, const std::vector<std::string>& words);
// As sorm DBX -where.
std::string where(sorma::Comm& comm, sorma::Sorm& sorm, const std::string& name);
void addRows();

}  // namespace directory
