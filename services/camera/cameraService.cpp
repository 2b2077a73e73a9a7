// camera -- pictures of the hand's camera, or of picture and video files, in the format that a caller wants.
//
//     camera EXEC                          -> floats time, width, height, exposure, request; any: the picture
//     camera EXEC snapshot board.png
//     getBrdSit CTRL -picture camera       raw pictures, as shmem_r of camera.image has them
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <list>
#include <optional>
#include <string_view>
#include <utility>

#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include <shmem/ring.h>
#include <sorma.h>

namespace {

using sorma::Message;
using sorma::Right;
using sorma::Severity;

const sorma::Prototype kWord{Severity::error, "CAMERA WORD", 2, "{}: bad word \"{}\": must be grab, latest, or snapshot and a file"};
const sorma::Prototype kHardware{Severity::error, "CAMERA HARDWARE", 1, "{}: there are no pictures: {}; start what writes them (simlab, or what drives the camera)"};
const sorma::Prototype kBuffer{Severity::error, "CAMERA BUFFER", 1, "{}: the camera cannot be asked: {}"};
const sorma::Prototype kTimeout{Severity::error, "CAMERA TIMEOUT", 1, "{}: no picture came within {} s, the buffer {} is {}; see -timeout"};
const sorma::Prototype kNone{Severity::error, "CAMERA NONE", 1, "{}: no picture has been taken yet"};
const sorma::Prototype kFile{Severity::error, "CAMERA FILE", 2, "{}: {}: {}"};
const sorma::Prototype kGone{Severity::error, "SERVICE GONE", 1, "{}: the service object has been removed"};

constexpr std::size_t kFloats = 5;                  // of a record: time, width, height, exposure, request
constexpr std::int64_t kLook = 2'000'000;           // [ns] between two looks for a picture that has been asked for

// An RGB picture, and the floats of its record.
struct Picture {
    std::vector<double> floats;
    cv::Mat rgb;
};

class Camera final : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Camera>("camera", "pictures of the hand's camera, or of files")
            .named("-prefix", &Camera::prefix_, {.help = "before the names of all buffers: another camera's", .fixed = true})
            .named("-file", &Camera::file_, {.help = "a picture (.bmp .jpeg .jpg .pgm .png .ppm .tif), or a video, to take pictures from; empty: the buffer camera.image"})
            .flag("-again", &Camera::again_, {.help = "at the end of a video begin again"})
            .choice("-format", &Camera::format_, {"raw", "ppm", "png", "jpeg"}, {.help = "of the picture in a reply; raw: red, green, blue of each pixel, top row first"})
            .integer("-quality", &Camera::quality_, {.unit = "%", .low = 1, .high = 100, .help = "of jpeg"})
            .real("-rate", &Camera::rate_, {.unit = "Hz", .low = 0, .high = 200, .help = "at which the camera takes pictures by itself; 0: on request"})
            .real("-exposure", &Camera::exposure_, {.unit = "1", .low = 0.01, .high = 100, .help = "factor of the brightness"})
            .real("-timeout", &Camera::timeout_, {.unit = "s", .low = 0.01, .high = 3600, .help = "within which a picture must come"})
            .words("?grab | latest | snapshot file?")
            .word("snapshot", &Camera::snapshot)
            .writes(floats, sorma::exactly(kFloats), "s, pixels", "lab time, width, height, exposure, number of the request; of a file: seconds of the video, and the number of the picture")
            .writes(any, {}, "", "the picture, by -format; snapshot: none")
            .writes(text, {}, "", "snapshot: the file")
            .concurrency(sorma::Concurrency::concurrent)
            .repeatable({"latest"})
            .example("camera CTRL -format png");
    }

    void changed(std::span<const sorma::Option* const> options) override {
        bool other = false, set = false;
        for (auto* o : options) {
            other = other || o->name == "-file";
            set = set || o->name == "-rate" || o->name == "-exposure";
        }
        if (other) video_.reset(), still_ = {};
        if (set && file_.empty() && (writer_ || rate_ > 0)) ask(request_);
    }

    void removing() override {
        timer_ = {};
        for (auto& w : std::exchange(waiting_, {})) w.reply.fail(sorma::Error(sorma::makeEntry(kGone, {of(name())})));
    }

    void exec(Message& m) override {
        if (execWord(m)) return;
        const std::string word = m.words.empty() ? "grab" : m.words[0];
        if ((word != "grab" && word != "latest") || m.words.size() > 1) fail(kWord, name(), sorma::joinWords(m.words));
        if (word == "grab") return grab(m, {});
        if (!file_.empty()) return answer(m, ofFile(true), {});
        attach();
        auto picture = newest();
        if (!picture) fail(kNone, name());
        answer(m, *picture, {});
    }

    void dumpState(std::string& out) const override {
        out += "# source " + sourceText() + "\n# requests " + std::to_string(waiting_.size()) + "\n";
    }

private:
    using Target = sorma::Named<sorma::Kind::file>;         // of a snapshot; empty: the picture goes into the reply
    struct Waiting {
        sorma::Reply reply;
        double request;
        std::int64_t until;                 // [ns]
        Target to;
    };

    void snapshot(Message& m, const Target& to) { grab(m, to); }

    // A new picture.
    void grab(Message& m, const Target& to) {
        if (!file_.empty()) return answer(m, ofFile(false), to);
        attach();
        ask(request_ + 1);
        sorma::Reply reply = later(m);
        waiting_.push_back({reply, request_, sorma::monotonicNow() + std::int64_t(timeout_ * 1e9), to});
        reply.onCancel([this, request = request_] {
            waiting_.remove_if([&](Waiting& w) { return w.request == request && (w.reply.complete(), true); });
        });
        if (waiting_.size() == 1) look();
    }

    // Where the pictures come from, for people.
    std::string sourceText() const {
        return file_.empty() ? prefix_.get(sorma::Permit::owner()) + "camera.image" : file_.get(sorma::Permit::owner());
    }

    // ---- the buffers ----

    void attach() {
        if (reader_ && !reader_->retired()) return;
        const std::string key = prefix_.use(*this) + "camera.image";
        try {
            reader_.emplace(key);
        } catch (const shmem::Failure& f) {
            reader_.reset();
            fail(kHardware, name(), f.what());
        }
        if (reader_->shape().floats == kFloats && reader_->shape().any > 0) return;
        const std::string size = std::to_string(reader_->shape().floats) + " floats and " + std::to_string(reader_->shape().any) + " bytes";
        reader_.reset();
        fail(kHardware, name(), "records of snapshot buffer " + key + " have " + size + "; 5 floats and a picture are expected");
    }

    // Rate, exposure, and a number: when it is a new one, a picture is taken at once.
    void ask(double request) {
        try {
            if (!writer_)
                writer_.emplace(prefix_.use(*this) + "camera.set", shmem::Shape{.blocks = 16, .floats = 4},
                                sorm().daemonName.empty() ? sorma::Caller::self().program : sorm().daemonName);
        } catch (const shmem::Failure& f) {
            fail(kBuffer, name(), f.what());
        }
        request_ = request;
        const double record[] = {double(sorma::monotonicNow()) * 1e-9, rate_, request_, exposure_};
        writer_->write(record, nullptr);
    }

    std::optional<Picture> newest() {
        Picture p;
        p.floats.resize(kFloats);
        bytes_.resize(reader_->shape().any);
        shmem::Stamp stamp;
        if (reader_->latest(p.floats.data(), bytes_.data(), stamp) != shmem::Outcome::read) return std::nullopt;
        const double w = p.floats[1], h = p.floats[2];
        if (!(w >= 1 && h >= 1 && w * h * 3 <= double(bytes_.size())))
            fail(kHardware, name(), "a record says " + sorma::numberText(w) + " x " + sorma::numberText(h) + " pixels, and has " + std::to_string(bytes_.size()) + " bytes");
        p.rgb = cv::Mat(int(h), int(w), CV_8UC3, bytes_.data());
        return p;
    }

    // Has what was asked for come? Requests are answered in their order: a picture answers all that were asked before it.
    void look() {
        try {
            attach();
            auto picture = newest();
            while (picture && !waiting_.empty() && waiting_.front().request <= picture->floats[4]) {
                auto w = std::move(waiting_.front());
                waiting_.pop_front();
                try {
                    answer(w.reply.message(), *picture, w.to);
                    w.reply.complete();
                } catch (const sorma::Error& e) {
                    w.reply.fail(e);
                }
            }
            while (!waiting_.empty() && sorma::monotonicNow() > waiting_.front().until) {
                auto w = std::move(waiting_.front());
                waiting_.pop_front();
                const std::string state = reader_->count() == 0 ? "empty" : "at request " + sorma::numberText(picture ? picture->floats[4] : 0) + ", this is " + sorma::numberText(w.request);
                w.reply.fail(sorma::Error(sorma::makeEntry(kTimeout, {of(name()), of(timeout_), of(sourceText()), of(state)})));
            }
        } catch (const sorma::Error& e) {
            for (auto& w : std::exchange(waiting_, {})) w.reply.fail(e);
        }
        if (!waiting_.empty()) timer_ = sorm().loop().after(sorma::monotonicNow() + kLook, [this] { look(); });
    }

    template <class T> static sorma::MessageArg of(const T& value) { return sorma::MessageArg::of(value); }

    // ---- files ----

    Picture ofFile(bool again) {
        if (still_.rgb.empty() && !video_) open();
        if (video_ && !(again && !still_.rgb.empty())) next();
        return still_;
    }

    void open() {
        struct stat status;
        const std::string& file = file_.use(*this);
        if (stat(file.c_str(), &status) != 0) fail(kFile, name(), file, std::strerror(errno));
        frames_ = 0;
        // A row of JPEGs is a video, and begins as a picture does: the ending decides.
        static constexpr std::string_view kPictures[] = {".bmp", ".jpeg", ".jpg", ".pgm", ".png", ".ppm", ".tif"};
        if (std::any_of(std::begin(kPictures), std::end(kPictures), [&](auto ending) { return file.ends_with(ending); })) {
            const cv::Mat bgr = cv::imread(file, cv::IMREAD_COLOR);
            if (!bgr.empty()) return keep(bgr, 0);
        }
        video_.emplace();
        if (video_->open(file)) return;
        video_.reset();
        fail(kFile, name(), file, "is neither a picture nor a video that OpenCV can read");
    }

    void next() {
        cv::Mat bgr;
        if (!video_->read(bgr) && again_ && frames_ > 0) {
            frames_ = 0;
            if (video_->open(file_.use(*this))) (void)video_->read(bgr);       // not all of them can be wound back
        }
        if (bgr.empty()) fail(kFile, name(), sourceText(), frames_ == 0 ? "has no picture" : "ends after " + std::to_string(frames_) + " pictures; -again begins again");
        const double rate = video_->get(cv::CAP_PROP_FPS);
        keep(bgr, rate > 0 ? double(frames_) / rate : 0);
        ++frames_;
    }

    void keep(const cv::Mat& bgr, double time) {
        cv::cvtColor(bgr, still_.rgb, cv::COLOR_BGR2RGB);
        if (exposure_ != 1) still_.rgb.convertTo(still_.rgb, -1, exposure_);
        still_.floats = {time, double(bgr.cols), double(bgr.rows), exposure_, double(frames_ + 1)};
    }

    // ---- replies ----

    void answer(Message& m, const Picture& p, const Target& target) {
        const std::string to = target.use(*this);
        m.clear();
        m.floats = p.floats;
        if (!to.empty()) {
            cv::Mat bgr;
            cv::cvtColor(p.rgb, bgr, cv::COLOR_RGB2BGR);
            bool written = false;
            try {
                written = cv::imwrite(to, bgr);
            } catch (const cv::Exception&) {        // an ending that it does not know
                fail(kFile, name(), to, "OpenCV writes no files with this ending: .png, .jpg, or .ppm");
            }
            if (!written) fail(kFile, name(), to, std::string("cannot be written: ") + std::strerror(errno));
            m.text = to;
            return;
        }
        if (format_ == "raw") return m.any.assign(p.rgb.data, p.rgb.data + p.rgb.total() * 3);
        cv::Mat bgr;
        cv::cvtColor(p.rgb, bgr, cv::COLOR_RGB2BGR);
        std::vector<int> how;
        if (format_ == "jpeg") how = {cv::IMWRITE_JPEG_QUALITY, int(quality_)};
        cv::imencode("." + format_, bgr, m.any, how);
    }

    sorma::Named<sorma::Kind::segment> prefix_;
    sorma::Named<sorma::Kind::file> file_;
    std::string format_ = "raw";
    bool again_ = false;
    std::int64_t quality_ = 90;
    double rate_ = 0, exposure_ = 1, timeout_ = 5;

    std::optional<shmem::Reader> reader_;
    std::optional<shmem::Writer> writer_;
    std::vector<unsigned char> bytes_;      // of the picture that was read last
    double request_ = std::floor(double(sorma::wallNow()) / 1000);     // numbers that no predecessor has used
    std::list<Waiting> waiting_;
    sorma::Timer timer_;
    std::optional<cv::VideoCapture> video_;
    Picture still_;                         // of the file, as read last
    std::int64_t frames_ = 0;               // of the video, that have been read
};

}  // namespace

extern "C" SORMA_EXPORT int Camera_Init(Tcl_Interp* interp) {
    // An error in a file is thrown, and not written to standard error.
    setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    return sorma::provide(interp, "sorma::service::camera", "1.0", {Camera::describe()});
}
