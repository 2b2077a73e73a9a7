// grab classify blobs moments -- what lies below findBall and getBrdSit, step by step, for those who wire it in another way.
//
//     grab.low CTRL -from camera -window {250 300 200 100}
//     classify.low CTRL -from grab.low -table colours.hsv
//     blobs.low CTRL -from classify.low
//     moments.low CTRL -from blobs.low
//     moments.low EXEC                        -> 8 floats of each blob
//
// Each one works on the data of its request; without data it works on those of -from.
#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "blobs.h"
#include "coloured.h"
#include "steps.h"

namespace vision {

namespace {

using sorma::Message;
using sorma::Severity;

const sorma::Prototype kNoInput{Severity::error, "VISION INPUT", 1, "{}: there is nothing to work on: set -from to an object that answers {}, or give it to EXEC"};
const sorma::Prototype kBlobs{Severity::error, "VISION INPUT", 1, "{}: {} is no list of blobs: it has {} floats; each blob has {}"};
const sorma::Prototype kWindow{Severity::error, "VISION WINDOW", 1, "{}: -window {} {} {} {} is not in the picture, which has {} x {} pixels"};

constexpr std::size_t kBlobFloats = 12, kMomentFloats = 8;
constexpr std::size_t kMostFloats = 1 << 20;

class Step : public Coloured {
public:
    void exec(Message& m) override {
        if (!m.any.empty() || !m.floats.empty()) return work(m, "what it got");
        if (!from_) fail(kNoInput, name(), input());
        const sorma::Reply reply = later(m);
        reply.ask(from_, Message(), [this, self = sorma::Reference(this), reply](Message& answered) {
            Message& answer = reply.message();
            answer.swap(answered);
            answer.text.clear(), answer.ints.clear();
            work(answer, "what " + from_->name() + " answered");
            reply.complete();
        });
    }

protected:
    virtual const char* input() const = 0;
    virtual void work(Message& m, const std::string& whose) = 0;

    template <class S> static sorma::Class fed(sorma::Class c, const char* by) {
        c.service("-from", &S::from_, {.help = std::string("answers ") + by});
        return c;
    }

    sorma::Reference from_;
};

class Grab final : public Step {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return fed<Grab>(sorma::Class::of<Grab>("grab", "a part of a picture, or a smaller one"), "pictures, as camera and shmem_r of camera.image do")
            .vector("-window", &Grab::window_, {.unit = "pixels", .low = 0, .high = 8192, .help = "left, top, width and height of the part; empty: all", .maxLength = 4})
            .integer("-shrink", &Grab::shrink_, {.unit = "1", .low = 1, .high = 32, .help = "so many pixels in a row become one"})
            .reads(floats, sorma::between(0, 16), "", "nothing, or a picture's time, width, height")
            .reads(any, {}, "", "a picture; none: -from is asked")
            .writes(floats, sorma::exactly(5), "s, pixels", "time, width, height, and where in the whole picture its first pixel is")
            .writes(any, {}, "", "red, green, blue of each pixel");
    }

private:
    const char* input() const override { return "a picture"; }
    void work(Message& m, const std::string& whose) override {
        const cv::Mat whole = pictureOf(name(), whose, m);
        cv::Rect part(0, 0, whole.cols, whole.rows);
        if (!window_.empty()) {
            auto at = [this](std::size_t i) { return i < window_.size() ? window_[i] : 0; };
            part = {int(at(0)), int(at(1)), int(at(2)), int(at(3))};
            if (part.empty() || (part & cv::Rect(0, 0, whole.cols, whole.rows)) != part)
                fail(kWindow, name(), at(0), at(1), at(2), at(3), whole.cols, whole.rows);
        }
        cv::Mat out;
        const int side = int(shrink_);
        if (side > 1) cv::resize(whole(part), out, {std::max(1, part.width / side), std::max(1, part.height / side)}, 0, 0, cv::INTER_AREA);
        else out = whole(part).clone();
        m.floats = {m.floats[0], double(out.cols), double(out.rows), double(part.x), double(part.y)};
        m.any.assign(out.data, out.data + out.total() * 3);
    }

    std::vector<double> window_;
    std::int64_t shrink_ = 1;
};

class Classify final : public Step {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return fed<Classify>(sorma::Class::of<Classify>("classify", "which class each pixel of a picture has: by a table of colours, or bright and dark"), "pictures, as camera and grab do")
            .named("-table", &Classify::file_, {.help = "file with the table of colours, as hsvtable has written it"})
            .integer("-threshold", &Classify::threshold_, {.unit = "1", .low = 0, .high = 255, .help = "pixels that are as bright have class 1, others 0; 0: the table decides"})
            .reads(floats, sorma::between(0, 16), "", "nothing, or a picture's time, width, height")
            .reads(any, {}, "", "a picture; none: -from is asked")
            .writes(floats, sorma::exactly(3), "s, pixels", "time, width, height")
            .writes(any, {}, "", "a byte for each pixel: 0 background; of a table: 1 red, 2 yellow, 3 violet");
    }
    void born() override { table_ = load(file_); }
    sorma::Commit prepare(const sorma::Change& change) override {
        if (!change.concerns("-table")) return nullptr;
        return [this, next = load(change.named<sorma::Kind::file>("-table"))]() mutable { std::swap(table_, next); };
    }

private:
    const char* input() const override { return "a picture"; }
    void work(Message& m, const std::string& whose) override {
        const cv::Mat picture = pictureOf(name(), whose, m);
        if (threshold_ > 0) {
            cv::cvtColor(picture, room_, cv::COLOR_RGB2GRAY);
            cv::threshold(room_, classes_, double(threshold_ - 1), 1, cv::THRESH_BINARY);
        } else {
            if (!table_) fail(kNoTable, name());
            table_->classify(picture, classes_, room_);
        }
        m.floats.resize(3);
        m.any.assign(classes_.data, classes_.data + classes_.total());
    }

    TableFile file_;
    std::int64_t threshold_ = 0;
    TablePointer table_;
    cv::Mat classes_, room_;
};

class Blobs final : public Step {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return fed<Blobs>(sorma::Class::of<Blobs>("blobs", "pixels of one class that hang together"), "classes of pixels, as classify does")
            .real("-leastArea", &Blobs::least_, {.unit = "pixels", .low = 1, .high = 1e8, .help = "smaller ones are left out"})
            .reads(floats, sorma::between(0, 16), "", "nothing, or time, width, height")
            .reads(any, {}, "", "a byte for each pixel, its class; none: -from is asked")
            .writes(floats, {}, "pixels", "12 of each blob, from the top: class, centroid u, v, area, left, top, right, bottom, central second moments uu, uv, vv by area, and 1 when it touches the border")
            .writes(ints, sorma::exactly(1), "", "how many");
    }

private:
    const char* input() const override { return "classes of pixels"; }
    void work(Message& m, const std::string& whose) override {
        const auto& found = finder_.find(pictureOf(name(), whose, m, 1, CV_8U), least_);
        m.floats.clear();
        for (auto& b : found)
            m.floats.insert(m.floats.end(), {double(b.colour), b.u, b.v, b.area, double(b.left), double(b.top), double(b.right), double(b.bottom), b.uu, b.uv,
                                             b.vv, double(b.clipped)});
        m.ints.assign(1, std::int64_t(found.size()));
        m.any.clear();
    }

    double least_ = 8;
    BlobFinder finder_;
};

class Moments final : public Step {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return fed<Moments>(sorma::Class::of<Moments>("moments", "the ellipses that have the moments of blobs"), "blobs, as blobs does")
            .reads(floats, sorma::between(0, kMostFloats), "pixels", "nothing, or 12 of each blob, as blobs answers them")
            .writes(floats, {}, "pixels, rad", "8 of each blob: class, centroid u, v, area, half axes a, b, angle of a, eccentricity")
            .writes(ints, sorma::exactly(1), "", "how many");
    }

private:
    const char* input() const override { return "blobs"; }
    void work(Message& m, const std::string& whose) override {
        if (m.floats.size() % kBlobFloats != 0) fail(kBlobs, name(), whose, m.floats.size(), kBlobFloats);
        std::vector<double> out;
        out.reserve(m.floats.size() / kBlobFloats * kMomentFloats);
        for (auto f = m.floats.begin(); f != m.floats.end(); f += kBlobFloats) {
            Blob blob;
            blob.uu = f[8], blob.uv = f[9], blob.vv = f[10];
            const Ellipse e = ellipseOf(blob);
            out.insert(out.end(), {f[0], f[1], f[2], f[3], e.a, e.b, e.angle, e.eccentricity()});
        }
        m.ints.assign(1, std::int64_t(out.size() / kMomentFloats));
        m.floats = std::move(out);
        m.any.clear();
    }
};

}  // namespace

std::vector<sorma::Class> steps() { return {Grab::describe(), Classify::describe(), Blobs::describe(), Moments::describe()}; }

}  // namespace vision
