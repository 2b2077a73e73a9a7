// lab.cpp -- the laboratory's mathematics in a program that knows nothing of SORMA.
#include <cstdio>

#include "lab/psom.h"
#include "lab/puma.h"

int main() {
    puma::Joints q = puma::Joints::Zero();
    auto pose = puma::forward(q);
    puma::Solutions solutions;
    q << 0.1, 0.2, 0.3, 0.4, 0.5, 0.6;
    puma::inverse(puma::forward(q), q, puma::Limits(), puma::Joints::Ones(), solutions);
    std::printf("flange %g %g %g, reached by %d postures\n", pose(0, 3), pose(1, 3), pose(2, 3), solutions.count);

    psom::Map map({{-1, 0, 1}}, 2);
    const double vectors[] = {-1, 1, 0, 0, 1, 1}, weights[] = {1, 0}, given[] = {0.5, 0};
    map.train(vectors);
    map.setWeights(weights, false);
    double w[2], s[1];
    map.complete(given, psom::Search(), w, s);
    std::printf("psom %.2f %.2f\n", w[0], w[1]);
    return 0;
}
