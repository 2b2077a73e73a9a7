// picture.h -- renders pictures of the scene, without a window, in a thread of its own.
//
// The camera of the hand and a free one share the thread and its graphics context (EGL, surfaceless). A shot contains all
// that can be seen, so the physics can go on meanwhile.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <future>
#include <mutex>
#include <thread>

#include "scene.h"

namespace simlab {

// Settings that change only the look.
struct Look {
    double light = 1;                                   // factor of the usual light
    std::array<double, 3> colour{1, 1, 1};              // of the light
    std::array<double, 3> direction{0.1, 0.3, -1};      // in which the lamp shines
    bool shadows = false;
    bool lamp = true;                                   // of the ball
};

struct Viewpoint {           // the free camera
    double azimuth = 140, elevation = -25, distance = 1.9;      // [degrees], [degrees], [m] from what it looks at
    std::array<double, 3> at{0.5, 0, 0.1};                      // [m]
};

struct Shot {
    std::vector<double> qpos, mocapPosition, mocapQuaternion;
    Look look;
    bool free = false;                  // by the free camera, not that of the hand
    Viewpoint view;
    int width = 500, height = 500;
    double exposure = 1;                // factor of the brightness
    double noise = 0;                   // [levels of 255] standard deviation
    std::uint64_t seed = 0;             // of the noise
};

struct Image {
    int width = 0, height = 0;
    std::vector<unsigned char> rgb;     // top row first
    std::string problem;                // why there is no picture; empty: there is one
    double milliseconds = 0;            // that it took
};

class Pictures {
public:
    static constexpr int kMostWidth = 800, kMostHeight = 600;
    using Done = std::function<void(Image)>;

    Pictures(const Scene& scene, int samples);      // returns when the context is there, or has failed: problem()
    ~Pictures() { halt(); }
    // End the thread and its context. Shots that wait, and later ones, are answered with a problem and no picture.
    void halt();

    void take(Shot shot, Done done);    // any thread; done is called by the thread that renders
    const std::string& problem() const { return problem_; }     // why there are no pictures at all

private:
    class Renderer;
    void run(Model model, int camera, int samples, std::promise<void>& ready);

    std::mutex mutex_;
    std::condition_variable wake_;
    std::deque<std::pair<Shot, Done>> shots_;
    bool stop_ = false;
    std::string problem_;               // does not change once the constructor has returned
    std::thread thread_;
};

}  // namespace simlab
