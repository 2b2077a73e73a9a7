// mend.h -- a sum that agrees for the head of a recording or of a block. So the reader goes on behind it.
#pragma once

#include <cstddef>
#include <cstring>
#include <string>

#include "recording/crc32c.h"

template <class Head> void mend(std::string& bytes, std::size_t at) {
    if (at > bytes.size() || bytes.size() - at < sizeof(Head)) return;
    Head head;
    std::memcpy(&head, bytes.data() + at, sizeof head);
    std::memcpy(head.magic, Head().magic, sizeof head.magic);
    head.check = sorma::crc32c(&head, offsetof(Head, check));
    std::memcpy(bytes.data() + at, &head, sizeof head);
}
