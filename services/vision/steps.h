// steps.h -- the steps below the classes that see, each as a class of its own: grab, classify, blobs, moments.
#pragma once

#include <vector>

#include <sorma.h>

namespace vision {

std::vector<sorma::Class> steps();

}  // namespace vision
