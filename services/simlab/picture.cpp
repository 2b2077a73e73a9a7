#include "picture.h"

#include <EGL/egl.h>
#include <EGL/eglext.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include <units/random.h>

namespace simlab {

namespace {

// A graphics context of this thread, which has no window.
class Context {
public:
    Context() {
        display_ = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
        if (display_ == EGL_NO_DISPLAY || !eglInitialize(display_, nullptr, nullptr))
            fail("EGL has no display without a window");
        const EGLint wanted[] = {
            EGL_SURFACE_TYPE,    EGL_PBUFFER_BIT, EGL_RED_SIZE, 8, EGL_GREEN_SIZE, 8, EGL_BLUE_SIZE, 8, EGL_DEPTH_SIZE, 24,
            EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT,  EGL_NONE};
        EGLConfig config;
        EGLint count = 0;
        if (!eglChooseConfig(display_, wanted, &config, 1, &count) || count < 1) fail("EGL has no configuration for OpenGL");
        eglBindAPI(EGL_OPENGL_API);
        context_ = eglCreateContext(display_, config, EGL_NO_CONTEXT, nullptr);
        if (context_ == EGL_NO_CONTEXT) fail("EGL makes no context");
        if (!eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_))
            fail("EGL does not let a context be used without a surface");
    }
    ~Context() {
        eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
        eglDestroyContext(display_, context_);
        eglReleaseThread();
    }
    Context(const Context&) = delete;
    Context& operator=(const Context&) = delete;

private:
    [[noreturn]] static void fail(const char* what) {
        char code[16];
        std::snprintf(code, sizeof code, "0x%x", unsigned(eglGetError()));
        throw std::runtime_error(std::string(what) + " (" + code + "); install libegl1 with Mesa's software renderer");
    }
    EGLDisplay display_;
    EGLContext context_ = EGL_NO_CONTEXT;
};

// Standard deviation 1, in 1/16; a picture takes them from some place on. Never deleted: when the process ends a picture may be under way.
const std::vector<signed char>& noiseTable() {
    static const auto& table = *[] {
        auto* t = new std::vector<signed char>(1 << 16);
        units::Random random(1);
        for (auto& x : *t) x = static_cast<signed char>(std::clamp(std::lround(16 * random.gaussian()), -127L, 127L));
        return t;
    }();
    return table;
}

}  // namespace

class Pictures::Renderer {
public:
    Renderer(Model model, int camera, int samples) : model_(std::move(model)), camera_(camera) {
        model_->vis.quality.offsamples = samples;
        model_->vis.global.offwidth = kMostWidth;
        model_->vis.global.offheight = kMostHeight;
        for (int i = 0; i < model_->nlight; ++i)
            for (int k = 0; k < 3; ++k) lights_.push_back(model_->light_diffuse[3 * i + k]);
        std::copy_n(model_->vis.headlight.ambient, 3, ambient_);
        std::copy_n(model_->vis.headlight.diffuse, 3, diffuse_);
        lamp_ = mj_name2id(model_.get(), mjOBJ_LIGHT, "lamp");
        glow_ = mj_name2id(model_.get(), mjOBJ_MATERIAL, "glow");
        data_.reset(mj_makeData(model_.get()));
        mjv_defaultOption(&option_);
        mjv_defaultScene(&scene_);
        mjv_makeScene(model_.get(), &scene_, 2000);
        mjr_defaultContext(&context_);
        mjr_makeContext(model_.get(), &context_, mjFONTSCALE_50);
        mjr_setBuffer(mjFB_OFFSCREEN, &context_);
    }
    ~Renderer() {
        mjr_freeContext(&context_);
        mjv_freeScene(&scene_);
    }

    Image render(const Shot& shot) {
        std::copy(shot.qpos.begin(), shot.qpos.end(), data_->qpos);
        std::copy(shot.mocapPosition.begin(), shot.mocapPosition.end(), data_->mocap_pos);
        std::copy(shot.mocapQuaternion.begin(), shot.mocapQuaternion.end(), data_->mocap_quat);
        apply(shot.look);
        mj_kinematics(model_.get(), data_.get());
        mj_camlight(model_.get(), data_.get());
        mjvCamera camera;
        mjv_defaultCamera(&camera);
        camera.type = shot.free ? mjCAMERA_FREE : mjCAMERA_FIXED;
        camera.fixedcamid = shot.free ? -1 : camera_;
        camera.azimuth = shot.view.azimuth;
        camera.elevation = shot.view.elevation;
        camera.distance = shot.view.distance;
        std::copy_n(shot.view.at.begin(), 3, camera.lookat);
        mjv_updateScene(model_.get(), data_.get(), &option_, nullptr, &camera, mjCAT_ALL, &scene_);
        scene_.flags[mjRND_SHADOW] = shot.look.shadows;
        const mjrRect frame{0, 0, shot.width, shot.height};
        mjr_render(frame, &scene_, &context_);
        Image image{shot.width, shot.height, {}, {}, 0};
        const std::size_t row = std::size_t(shot.width) * 3;
        pixels_.resize(row * std::size_t(shot.height));
        mjr_readPixels(pixels_.data(), nullptr, frame, &context_);
        image.rgb.resize(pixels_.size());
        for (int y = 0; y < shot.height; ++y)       // it comes bottom row first
            std::copy_n(pixels_.data() + std::size_t(shot.height - 1 - y) * row, row,
                        image.rgb.data() + std::size_t(y) * row);
        expose(shot, image);
        return image;
    }

private:
    void apply(const Look& look) {
        for (std::size_t i = 0; i < lights_.size(); ++i)
            model_->light_diffuse[i] = float(lights_[i] * look.light * look.colour[i % 3]);
        for (std::size_t k = 0; k < 3; ++k) {
            model_->vis.headlight.ambient[k] = float(ambient_[k] * look.light * look.colour[k]);
            model_->vis.headlight.diffuse[k] = float(diffuse_[k] * look.light * look.colour[k]);
        }
        if (lamp_ >= 0)
            for (std::size_t k = 0; k < 3; ++k) {
                static constexpr double kLit[3] = {0.5, 0, 0};      // what the lamp points at
                model_->light_dir[3 * std::size_t(lamp_) + k] = look.direction[k];
                model_->light_pos[3 * std::size_t(lamp_) + k] =
                    kLit[k] - 2 * look.direction[k] / std::fabs(look.direction[2]);
            }
        if (glow_ >= 0) model_->mat_emission[glow_] = look.lamp ? 1.f : 0.f;
    }

    void expose(const Shot& shot, Image& image) {
        if (shot.exposure != 1) {
            unsigned char curve[256];
            for (int i = 0; i < 256; ++i)
                curve[i] = static_cast<unsigned char>(std::clamp(std::lround(i * shot.exposure), 0L, 255L));
            for (auto& x : image.rgb) x = curve[x];
        }
        if (shot.noise <= 0) return;
        const auto& table = noiseTable();
        const int factor = int(std::lround(shot.noise * 16));
        units::Random random(shot.seed);
        for (std::size_t i = 0; i < image.rgb.size();) {
            std::size_t at = random.next() % table.size();          // a new place now and then: no pattern is seen twice
            const std::size_t end = std::min(image.rgb.size(), i + 1000);
            for (; i < end; ++i, at = (at + 1) % table.size())
                image.rgb[i] =
                    static_cast<unsigned char>(std::clamp(int(image.rgb[i]) + (table[at] * factor + 128) / 256, 0, 255));
        }
    }

    Context graphics_;
    Model model_;
    Data data_;
    const int camera_;
    int lamp_, glow_;
    std::vector<float> lights_;
    float ambient_[3], diffuse_[3];
    mjvOption option_;
    mjvScene scene_;
    mjrContext context_;
    std::vector<unsigned char> pixels_;
};

Pictures::Pictures(const Scene& scene, int samples) {
    Model copy(mj_copyModel(nullptr, scene.model.get()));
    std::promise<void> ready;
    thread_ = std::thread([this, camera = scene.camera, samples, model = std::move(copy), &ready]() mutable {
        run(std::move(model), camera, samples, ready);
    });
    ready.get_future().wait();
}

void Pictures::halt() {
    {
        std::lock_guard lock(mutex_);
        stop_ = true;
    }
    wake_.notify_all();
    if (thread_.joinable()) thread_.join();
}

void Pictures::take(Shot shot, Done done) {
    {
        std::lock_guard lock(mutex_);
        if (!stop_) {
            shots_.emplace_back(std::move(shot), std::move(done));
            done = nullptr;
        }
    }
    if (done) return done({0, 0, {}, "the laboratory ends", 0});
    wake_.notify_all();
}

void Pictures::run(Model model, int camera, int samples, std::promise<void>& ready) {
    std::unique_ptr<Renderer> renderer;
    try {
        renderer = std::make_unique<Renderer>(std::move(model), camera, samples);
    } catch (const std::exception& e) {
        problem_ = e.what();
    }
    ready.set_value();
    std::unique_lock lock(mutex_);
    for (;;) {
        wake_.wait(lock, [this] { return stop_ || !shots_.empty(); });
        if (shots_.empty()) return;
        auto [shot, done] = std::move(shots_.front());
        shots_.pop_front();
        const bool wanted = !stop_;
        lock.unlock();
        Image image;
        image.problem = wanted ? problem_ : "the laboratory ends";
        if (wanted && renderer) {
            const auto begin = std::chrono::steady_clock::now();
            try {
                image = renderer->render(shot);
            } catch (const std::exception& e) {
                image.problem = e.what();
            }
            image.milliseconds = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
        }
        done(std::move(image));
        lock.lock();
    }
}

}  // namespace simlab
