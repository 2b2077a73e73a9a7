// steps.h -- the steps of image processing as classes of their own: grab, classify, blobs, moments.
#pragma once

#include <vector>

#include <sorma.h>

namespace vision {

std::vector<sorma::Class> steps();

}  // namespace vision
