// hsvtable findBall findBrdMarker getBrdSit getDisk -- what a camera sees: colours, a ball, a draughts board and its tokens.
//
//     getBrdSit.main CTRL -table colours.hsv -picture shmem_r.camera -pose shmem_r.tool
//     getBrdSit.main EXEC                       -> TMSG ...r.y.y...  FMSG 64 confidences
//
// A picture is a record as camera.image has it: floats time, width, height ...; any RGB, 8 bits, top row first. The option -picture
// names the object that returns one; an EXEC with a picture asks nobody. See doc/vision.man.
#include <array>
#include <cmath>
#include <ctime>
#include <memory>

#include <fmt/chrono.h>
#include <sorma.h>

#include "ball.h"
#include "boardReader.h"
#include "colourTable.h"
#include "coloured.h"
#include "drawing.h"
#include "steps.h"

namespace {

using sorma::Message;
using sorma::Severity;
using vision::Coloured;
using vision::TablePointer;
using vision::kNoPicture;
using vision::kNoTable;
using vision::kTable;
using vision::pictureOf;

const sorma::Prototype kWord{Severity::error, "VISION WORD", 2, "{}: bad word \"{}\": must be one of {}"};
const sorma::Prototype kFloats{Severity::error, "VISION FLOATS", 1, "{}: EXEC expects {}, got {} floats"};
const sorma::Prototype kPose{Severity::error, "VISION POSE", 1, "{}: {} answered {} floats; a pose is time, position 3, quaternion 4 (w x y z)"};
const sorma::Prototype kUnit{Severity::error, "VISION POSE", 1, "{}: the quaternion {} {} {} {} of {} has the length {}; it must be 1"};
const sorma::Prototype kStream{Severity::error, "OPTION MISSING", 2, "{}: {} is not set; -stream needs -picture and -results"};
const sorma::Prototype kMarkers{Severity::error, "VISION MARKERS", 1, "{}: no board: {}"};
const sorma::Prototype kBoard{Severity::error, "VISION BOARD", 1, "{}: the board cannot be read: {}"};
const sorma::Prototype kDisk{Severity::error, "VISION DISK", 1, "{}: no {} token near {:.4g} {:.4g}: {}"};
const sorma::Prototype kColour{Severity::error, "VISION WORD", 2, "{}: bad colour \"{}\": must be red, violet, or yellow"};
const sorma::Prototype kLabels{Severity::error, "VISION PICTURE", 1, "{}: the labels of {} are missing: after 3 bytes for each pixel there must be one with its colour, 0 to 3"};
const sorma::Prototype kUntrained{Severity::error, "VISION TABLE", 1, "{}: nothing has been learned yet: EXEC train a labelled picture first"};

class Hsvtable : public Coloured {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Hsvtable>("hsvtable", "a table that tells the colours of the board's things; learned from labelled pictures")
            .named("-file", &Hsvtable::file_, {.help = "file to take the table from, as CTRL -save has written it; empty: all is background"})
            .action("-save", &Hsvtable::save, "file", "write the table to a file, for -file and for -table of the others", 1, sorma::Right::inspect, true)
            .action("-learn", &Hsvtable::learn, "", "make the table of all pictures that EXEC train was given")
            .action("-unlearn", &Hsvtable::unlearn, "", "forget these pictures; the table stays until the next -learn")
            .words("code|classify|train")
            .reads(floats, sorma::between(3, 16), "", "code: red, green, blue (0 to 255); others: a picture's time, width, height")
            .reads(any, {}, "", "classify: RGB, 3 bytes for each pixel; train: the same, then a byte for each pixel with its colour: 0 background, "
                                "1 red, 2 yellow, 3 violet, others: unknown")
            .writes(ints, sorma::between(0, 2), "1", "code: of 6 bits hue, 5 saturation, 5 brightness, and its colour; train: pictures so far")
            .writes(floats, {}, "", "classify: time, width, height")
            .writes(any, {}, "", "classify: a byte for each pixel, with its colour")
            .example("hsvtable EXEC code FMSG 3 204 15 10");
    }

    void born() override {
        if (auto table = load(file_, &origin_)) table_ = table;
    }
    sorma::Commit prepare(const sorma::Change& change) override {
        std::string origin;
        auto next = change.concerns("-file") ? load(change.named<sorma::Kind::file>("-file"), &origin) : nullptr;
        if (!next) return nullptr;
        return [this, next, origin]() mutable {
            std::swap(table_, next);
            std::swap(origin_, origin);
        };
    }

    void exec(Message& m) override {
        const std::string word = m.words.empty() ? "" : m.words[0];
        if (m.words.size() != 1 || (word != "code" && word != "classify" && word != "train"))
            fail(kWord, name(), word, "classify, code, or train");
        if (word == "code") return code(m);
        cv::Mat picture = pictureOf(name(), "what it got", m, word == "train" ? 4 : 3);
        if (word == "train") return train(picture, m);
        cv::Mat colours, hsv;
        table_->classify(picture, colours, hsv);
        m.any.assign(colours.data, colours.data + colours.total());
        m.floats.resize(3);
        m.words.clear();
    }

    void dumpState(std::string& out) const override {
        out += "# origin " + origin_ + "\n# pictures " + std::to_string(training_.pictures()) + "\n";
        for (std::size_t c = 0; c < vision::kColours; ++c)
            out += std::string("# ") + vision::kColourNames[c] + " " + std::to_string(training_.samples(vision::Colour(c))) + "\n";
    }

private:
    void save(Message&, const sorma::Named<sorma::Kind::file>& file) {
        try {
            table_->save(file.use(*this), origin_);
        } catch (const std::runtime_error& e) {
            fail(kTable, name(), e.what());
        }
    }
    void code(Message& m) {
        if (m.floats.size() != 3) fail(kFloats, name(), "red, green and blue", m.floats.size());
        std::array<std::uint8_t, 3> rgb;
        for (std::size_t i = 0; i < 3; ++i) {
            if (!(m.floats[i] >= 0 && m.floats[i] <= 255)) fail(kFloats, name(), "red, green and blue from 0 to 255", m.floats[i]);
            rgb[i] = std::uint8_t(std::lround(m.floats[i]));
        }
        const auto code = vision::codeOf(rgb[0], rgb[1], rgb[2]);
        m.clear();
        m.ints = {code, (*table_)[code]};
    }
    void train(const cv::Mat& picture, Message& m) {
        const std::size_t pixels = picture.total();
        training_.add(picture, cv::Mat(picture.rows, picture.cols, CV_8U, m.any.data() + 3 * pixels));
        m.clear();
        m.ints.assign(1, std::int64_t(training_.pictures()));
    }
    void learn(sorma::Args, Message& m) {
        if (training_.pictures() == 0) fail(kUntrained, name());
        table_ = std::make_shared<vision::ColourTable>(training_.table());
        origin_ = std::to_string(training_.pictures()) + " pictures, " + std::to_string(training_.clusters()) + " clusters, " +
                  fmt::format("{:%Y-%m-%d}", fmt::localtime(std::time(nullptr)));
        m.text = origin_;
    }

    void unlearn(sorma::Args, Message&) { training_ = {}; }

    TableFile file_;
    std::string origin_;
    TablePointer table_ = std::make_shared<vision::ColourTable>();
    vision::Training training_;
};

// ---- those that look at a picture ----

class Looker : public Coloured {
public:
    void exec(Message& m) override {
        const bool debug = !m.words.empty() && m.words[0] == "debug";
        if (debug) m.words.erase(m.words.begin());
        check(m);
        if (!m.any.empty()) {
            cv::Mat picture = pictureOf(name(), "what it got", m);
            Message out;
            see(debug, picture, m.floats[0], m, viewOf(picture, at_, "-at"), out);
            m.any.clear();
            m.words.clear();
            m.floats.swap(out.floats), m.ints.swap(out.ints), m.text.swap(out.text), m.any.swap(out.any);
            m.code = out.code;
            return;
        }
        if (!picture_) fail(kNoPicture, name());
        auto job = std::make_shared<Job>();
        job->self = sorma::Reference(this);
        job->asked.floats = m.floats;
        job->asked.words = m.words;
        job->asked.text = m.text;
        job->debug = debug;
        job->reply = later(m);
        job->reply.ask(picture_, Message(), [this, job](Message& picture) {
            job->picture.floats.swap(picture.floats);
            job->picture.any.swap(picture.any);
            if (!pose_) return finish(job, at_, "-at");
            job->reply.ask(pose_, Message(), [this, job](Message& m) {
                if (m.floats.size() < 8) fail(kPose, name(), pose_->name(), m.floats.size());
                finish(job, std::vector<double>(m.floats.begin() + 1, m.floats.begin() + 8), pose_->name());
            });
        });
    }

protected:
    // Read the words of the request first.
    virtual void check(const Message& m) const {
        if (!m.words.empty()) fail(kWord, name(), m.words[0], "debug");
    }
    // The answer to asked, of what there is in a picture.
    virtual void look(const cv::Mat& picture, double time, const Message& asked, const vision::CameraView& view, Message& answer) = 0;

    template <class S> static sorma::Class looking(sorma::Class c, bool colours = true) {
        c.service("-picture", &S::picture_, {.help = "answers a picture: floats time, width, height; any RGB; as shmem_r of camera.image does"})
            .service("-pose", &S::pose_, {.help = "answers where the tool is: floats time, position 3, quaternion 4; none: -at"})
            .vector("-at", &S::at_, {.low = -100, .high = 100, .help = "where the tool is [m], [1]: position, quaternion w x y z", .minLength = 7, .maxLength = 7})
            .vector("-mount", &S::mount_, {.low = -100, .high = 100, .help = "the camera (x right, y down, z forward) in the tool's frame [m], [1]: position, quaternion",
                                           .minLength = 7, .maxLength = 7})
            .real("-fieldOfView", &S::fieldOfView_, {.unit = "rad", .low = 0.05, .high = 3, .help = "of the lens, from the top row to the bottom row"});
        c.words("?debug?").writes(sorma::Field::any, {}, "", "debug: the picture with what was found in it, PPM");
        if (colours) c.named("-table", &S::tableFile_, {.help = "file with the table of colours, as hsvtable has written it"});
        return c;
    }

    const std::vector<vision::Blob>& blobs(const cv::Mat& picture) {
        if (!table_) fail(kNoTable, name());
        table_->classify(picture, colours_, hsv_);
        const auto& found = finder_.find(colours_, 8);
        if (drawing_) drawing_->blobs(found);
        return found;
    }

    void born() override { table_ = load(tableFile_); }
    sorma::Commit prepare(const sorma::Change& change) override {
        if (!change.concerns("-table")) return nullptr;
        return [this, next = load(change.named<sorma::Kind::file>("-table"))]() mutable { std::swap(table_, next); };
    }

private:
    struct Job {
        sorma::Reference self;
        sorma::Reply reply;
        Message asked, picture;
        bool debug = false;
    };

    void finish(const std::shared_ptr<Job>& job, const std::vector<double>& pose, const std::string& whose) {
        cv::Mat picture = pictureOf(name(), "what " + picture_->name() + " answered", job->picture);
        job->reply.message().clear();
        see(job->debug, picture, job->picture.floats[0], job->asked, viewOf(picture, pose, whose), job->reply.message());
        job->reply.complete();
    }

    // For debug the answer is the picture with what was found in it; why nothing was is its text, and the code is 1.
    void see(bool debug, const cv::Mat& picture, double time, const Message& asked, const vision::CameraView& view, Message& answer) {
        if (!debug) return look(picture, time, asked, view, answer);
        vision::Drawing drawing(picture);
        drawing_ = &drawing;
        try {
            look(picture, time, asked, view, answer);
        } catch (const sorma::Error& e) {
            answer.clear();
            answer.text = e.what();
            answer.code = 1;
        } catch (...) {
            drawing_ = nullptr;
            throw;
        }
        drawing_ = nullptr;
        if (answer.code) drawing.text(4, 14, answer.text, vision::Drawing::bad);
        drawing.ppm(answer.any);
    }

    Eigen::Isometry3d frame(const std::vector<double>& v, const std::string& whose) const {
        Eigen::Quaterniond q(v[3], v[4], v[5], v[6]);
        if (!(std::abs(q.norm() - 1) < 1e-3)) fail(kUnit, name(), v[3], v[4], v[5], v[6], whose, q.norm());
        return Eigen::Translation3d(v[0], v[1], v[2]) * q.normalized();
    }

protected:
    vision::CameraView viewOf(const cv::Mat& picture, const std::vector<double>& tool, const std::string& whose) const {
        return {vision::Lens::of(picture.cols, picture.rows, fieldOfView_), frame(tool, whose) * frame(mount_, "-mount")};
    }

    sorma::Reference picture_, pose_;
    // Above the middle of the board, looking down; and the camera of the laboratory's hand, 12 degrees towards the tool's axis.
    std::vector<double> at_{0.57, 0, 0.45, 0, 1, 0, 0}, mount_{0.115, 0, -0.150, 0.703233, -0.0739128, -0.0739128, 0.703233};
    double fieldOfView_ = 1.0122909661567112;
    TableFile tableFile_;
    TablePointer table_;
    cv::Mat colours_, hsv_;
    vision::BlobFinder finder_;
    vision::Drawing* drawing_ = nullptr;    // not null during a request for debug: the results are drawn into it
};

class FindBall : public Looker {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return looking<FindBall>(sorma::Class::of<FindBall>("findball", "where a bright ball is in a picture, and whether that is to be believed"), false)
            .integer("-threshold", &FindBall::threshold_, {.unit = "1", .low = 1, .high = 255, .help = "what is not darker is the ball"})
            .vector("-radius", &FindBall::radius_, {.unit = "pixels", .low = 1, .high = 4096, .help = "least and largest", .minLength = 2, .maxLength = 2})
            .real("-roundness", &FindBall::roundness_, {.unit = "1", .low = 0, .high = 1, .help = "least b/a, of what the lens makes of a ball there, from 15 pixels of radius on; else 0.8"})
            .real("-solidity", &FindBall::solid_, {.unit = "1", .low = 0, .high = 1, .help = "least part of its ellipse that is bright"})
            .real("-second", &FindBall::second_, {.unit = "1", .low = 0, .high = 1, .help = "what is as large as that, of the largest one's area, may be the ball, too"})
            .real("-step", &FindBall::step_, {.unit = "pixels", .low = 1, .high = 4096, .help = "in a stream the ball is looked for so near to where it was before: what is seen beside it stays another one"})
            .real("-doubt", &FindBall::doubt_, {.unit = "s", .low = 0, .high = 3600, .help = "in a stream another one, when it is alone, is taken for the ball after so long"})
            .service("-results", &FindBall::results_, {.help = "is told of each picture while -stream is set: floats of a record of ball.obs, as shmem_w takes them"})
            .flag("-stream", &FindBall::stream_, {.help = "look at each picture that -picture, a shmem_r, brings, and tell -results; the ball is looked for "
                                                          "in the whole picture"})
            .words("?debug? ?window?")
            .reads(floats, sorma::between(0, 16), "pixels", "window: u, v of its middle, width, height; with a picture: after time, width, height")
            .reads(any, {}, "", "a picture; none: -picture is asked")
            .writes(floats, sorma::exactly(9), "", "lab time, u, v, area, radius [pixels], eccentricity, angle [rad], code, time when done: a record of ball.obs")
            .writes(text, {}, "", "what the code says: valid, none, clipped, size, shape, occluded or ambiguous, with what was measured")
            .example("findball CTRL -threshold 240");
    }

    void born() override {
        Looker::born();
        changed({});
    }
    void changed(std::span<const sorma::Option* const>) override {
        if (stream_ && (!picture_ || !results_)) fail(kStream, name(), picture_ ? "-results" : "-picture");
        if (stream_ != bool(next_)) stream_ ? askNext() : end();
    }
    void removing() override { end(); }
    void dumpState(std::string& out) const override {
        for (std::size_t i = 0; i < std::size(counts_); ++i) out += std::string("# ") + vision::kVerdicts[i] + " " + std::to_string(counts_[i]) + "\n";
        if (!trouble_.empty()) out += "# trouble " + trouble_ + "\n";
    }

protected:
    void check(const Message& m) const override {
        const std::size_t head = m.any.empty() ? 0 : 3;
        const bool window = !m.words.empty();
        if (m.words.size() > 1 || (window && m.words[0] != "window")) fail(kWord, name(), m.words.back(), "window");
        if (window && m.floats.size() < head + 4) fail(kFloats, name(), "u, v, width and height of a window", m.floats.size());
        for (double x : m.floats)
            if (!(std::abs(x) < 1e9)) fail(kFloats, name(), "finite numbers", x);
    }
    // A request beside the stream gets the stream's answer, and changes nothing.
    void look(const cv::Mat& picture, double time, const Message& asked, const vision::CameraView& view, Message& answer) override {
        vision::BallMemory aside = asked.any.empty() ? memory_ : vision::BallMemory();
        see(picture, time, asked, view, answer, aside);
    }

private:
    void see(const cv::Mat& picture, double time, const Message& asked, const vision::CameraView& view, Message& answer, vision::BallMemory& memory) {
        std::optional<cv::Rect> window;
        if (!asked.words.empty()) {
            const double* w = asked.floats.data() + (asked.any.empty() ? 0 : 3);
            window = cv::Rect(int(w[0] - w[2] / 2), int(w[1] - w[3] / 2), int(std::max(1.0, w[2])), int(std::max(1.0, w[3])));
        }
        const vision::BallRules rules{.threshold = int(threshold_), .least = radius_[0], .most = radius_[1], .round = roundness_, .solid = solid_, .second = second_,
                                      .step = step_, .doubt = doubt_};
        const auto s = ball_.find(picture, view.lens, rules, window, time, memory);
        answer.floats = {time, s.u, s.v, s.area, s.radius, s.eccentricity, s.angle, double(s.verdict), time};
        answer.text = vision::kVerdicts[int(s.verdict)];
        if (s.limit != 0) answer.text += ": " + sorma::numberText(s.measured) + ", the limit is " + sorma::numberText(s.limit);
        if (!drawing_) return;
        const auto colour = s.verdict == vision::Verdict::valid ? vision::Drawing::good : vision::Drawing::bad;
        if (window) drawing_->box(window->x, window->y, window->x + window->width, window->y + window->height, vision::Drawing::note);
        drawing_->text(4, 14, answer.text, colour);
        if (s.area > 0) drawing_->circle(s.u, s.v, s.radius, colour), drawing_->cross(s.u, s.v, colour);
    }

    // ---- pictures one after another ----

    void askNext() {
        Message m;
        m.words = {"next", "1"};
        if (counter_) m.words.push_back(std::to_string(*counter_));
        next_ = picture_->async(sorma::Method::exec, std::move(m));
        next_.then([self = sorma::Reference(this), this, round = round_](sorma::Future picture) {
            if (round != round_) return;
            try {
                take(picture.result());
                trouble_.clear();
            } catch (const sorma::Error& e) {
                counter_ = countAfter(e);
                if (!e.is("SHMEM TIMEOUT")) trouble_ = e.what();
            } catch (const std::exception& e) {
                trouble_ = e.what();
            }
            if (trouble_.empty()) return askNext();
            constexpr std::int64_t kPause = 50'000'000;     // [ns]
            pause_ = sorm().loop().after(sorma::monotonicNow() + kPause, [this] { askNext(); });
        });
    }
    void end() {
        ++round_;
        pause_ = {};
        if (auto next = std::exchange(next_, {})) next.cancel();
        counter_.reset();
        memory_.forget();
    }
    // How many pictures there were when there was no new one: what comes before it is asked again is not missed.
    static std::optional<std::uint64_t> countAfter(const sorma::Error& e) {
        if (e.is("SHMEM ABSENT")) return 0;
        std::int64_t count = 0;
        if (!e.is("SHMEM TIMEOUT") || !sorma::parseNumber(e.code().back(), count)) return std::nullopt;
        return std::uint64_t(count);
    }
    void take(Message& m) {
        const bool stamped = m.ints.size() >= 2;
        if (stamped) counter_ = std::uint64_t(m.ints[0]);
        const cv::Mat picture = pictureOf(name(), "what " + picture_->name() + " answered", m);
        Message answer;
        see(picture, m.floats[0], Message(), viewOf(picture, at_, "-at"), answer, memory_);
        // Lab time goes as the machine's clock does since the picture was published.
        if (stamped) answer.floats[8] += double(sorma::monotonicNow() - m.ints[1]) * 1e-9;
        ++counts_[std::size_t(answer.floats[7])];
        answer.text.clear();
        results_->invoke(sorma::Method::exec, answer);
    }

    sorma::Reference results_;
    bool stream_ = false;
    sorma::Future next_;                    // while it streams
    unsigned round_ = 0;                    // of streaming: what an older one has asked for is not looked at
    sorma::Timer pause_;
    std::optional<std::uint64_t> counter_;  // later pictures than this one are new; empty: those to come
    std::array<std::uint64_t, std::size(vision::kVerdicts)> counts_{};
    std::string trouble_;

    std::int64_t threshold_ = 250;
    std::vector<double> radius_{4, 120};
    double roundness_ = 0.96, solid_ = 0.95, second_ = 0.3, step_ = 60, doubt_ = 2;
    vision::BallFinder ball_;
    vision::BallMemory memory_;             // of the stream
};

class BoardLooker : public Looker {
protected:
    template <class S> static sorma::Class onBoard(sorma::Class c) {
        return looking<S>(std::move(c))
            .integer("-fields", &S::fields_, {.unit = "1", .low = 2, .high = 26, .help = "of a side of the board"})
            .real("-field", &S::field_, {.unit = "m", .low = 0.001, .high = 1, .help = "side of a field"})
            .vector("-markers", &S::markers_, {.unit = "m", .low = 0, .high = 10, .help = "how far behind the middle of the board the markers are, and how far to its sides",
                                               .minLength = 2, .maxLength = 2})
            .vector("-token", &S::token_, {.unit = "m", .low = 1e-4, .high = 1, .help = "radius and height of a token", .minLength = 2, .maxLength = 2});
    }
    vision::BoardShape shape() const { return {int(fields_), field_, markers_[0], markers_[1], token_[0], token_[1]}; }
    vision::BoardPose board(const std::vector<vision::Blob>& blobs, const vision::CameraView& view) const {
        auto pose = vision::findMarkers(blobs, view, shape());
        if (!pose.trouble.empty()) fail(kMarkers, name(), pose.trouble);
        if (drawing_) {
            const double side = field_ * double(fields_) / 2;
            const auto corner = [&](double x, double y) { return view.pixelOf(pose.world(x, y, 0)); };
            const Eigen::Vector2d corners[] = {corner(side, side), corner(side, -side), corner(-side, -side), corner(-side, side)};
            for (std::size_t i = 0; i < 4; ++i) drawing_->line(corners[i], corners[(i + 1) % 4], vision::Drawing::good);
            drawing_->text(pose.a.x() + 8, pose.a.y(), "A", vision::Drawing::good);
            drawing_->text(pose.b.x() + 8, pose.b.y(), "B", vision::Drawing::good);
        }
        return pose;
    }

    std::int64_t fields_ = 8;
    double field_ = 0.045;
    std::vector<double> markers_{0.206, 0.160}, token_{0.015, 0.008};
};

class FindBrdMarker : public BoardLooker {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return onBoard<FindBrdMarker>(sorma::Class::of<FindBrdMarker>("findbrdmarker", "where the board lies, by its two violet markers"))
            .reads(floats, sorma::between(0, 16), "", "nothing, or a picture's time, width, height")
            .reads(any, {}, "", "a picture; none: -picture is asked")
            .writes(floats, sorma::exactly(7), "", "pixels u v of the large marker, u v of the small one; x, y [m], yaw [rad] of the board in the world")
            .writes(text, {}, "", "debug: why no board was found");
    }

protected:
    void look(const cv::Mat& picture, double, const Message&, const vision::CameraView& view, Message& answer) override {
        const auto pose = board(blobs(picture), view);
        answer.floats = {pose.a.x(), pose.a.y(), pose.b.x(), pose.b.y(), pose.x, pose.y, pose.yaw};
    }
};

class GetBrdSit : public BoardLooker {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return onBoard<GetBrdSit>(sorma::Class::of<GetBrdSit>("getbrdsit", "what stands on each field of the board"))
            .reads(floats, sorma::between(0, 16), "", "nothing, or a picture's time, width, height")
            .reads(any, {}, "", "a picture; none: -picture is asked")
            .writes(text, {}, "", "for each field: . empty, r red, y yellow, ? uncertain; the last rank first, file a first")
            .writes(floats, {}, "1", "how certain each of them is, 0 to 1")
            .writes(ints, sorma::exactly(1), "1", "how many pictures of different times, one after another, have shown the same, this one included");
    }

protected:
    void look(const cv::Mat& picture, double time, const Message&, const vision::CameraView& view, Message& answer) override {
        const auto& found = blobs(picture);
        const auto pose = board(found, view);
        auto s = vision::readBoard(found, view, shape(), pose);
        if (drawing_)
            for (std::size_t i = 0; i < s.symbols.size(); ++i) {
                const auto n = std::size_t(fields_);
                const double rank = double(n - 1 - i / n), file = double(i % n), middle = double(n) / 2 - 0.5;
                const auto at = view.pixelOf(pose.world((middle - rank) * field_, (file - middle) * field_, token_[1]));
                drawing_->text(at.x() - 4, at.y() + 4, s.symbols.substr(i, 1), s.symbols[i] == '?' ? vision::Drawing::bad : vision::Drawing::note);
            }
        if (!s.trouble.empty()) {
            agree_ = 0;
            fail(kBoard, name(), s.trouble);
        }
        if (s.symbols != last_) agree_ = 1;
        else if (time != time_) ++agree_;
        last_ = s.symbols;
        time_ = time;
        answer.text = std::move(s.symbols);
        answer.floats = std::move(s.confidences);
        answer.ints.assign(1, agree_);
    }

private:
    std::string last_;
    double time_ = 0;
    std::int64_t agree_ = 0;
};

class GetDisk : public Looker {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return looking<GetDisk>(sorma::Class::of<GetDisk>("getdisk", "exactly where one token is, near a pixel where it is expected"))
            .real("-radius", &GetDisk::radius_, {.unit = "pixels", .low = 2, .high = 1000, .help = "of a token, as it is expected"})
            .real("-error", &GetDisk::error_, {.unit = "pixels", .low = 0, .high = 1000, .help = "how far off the expected place may be"})
            .reads(floats, sorma::between(2, 16), "pixels", "u, v where it is expected; with a picture: after time, width, height")
            .reads(text, {}, "", "red, yellow or violet; none: red")
            .reads(any, {}, "", "a picture; none: -picture is asked")
            .writes(floats, sorma::exactly(4), "", "u, v [pixels], area [pixels], how well it fits (0 to 1)")
            .writes(text, {}, "", "debug: why no token was found")
            .example("getdisk CTRL -radius 30");
    }

protected:
    void check(const Message& m) const override {
        Looker::check(m);
        if (m.floats.size() != (m.any.empty() ? 2 : 5)) fail(kFloats, name(), m.any.empty() ? "u and v" : "time, width, height, u and v", m.floats.size());
        colourOf(m.text);
    }
    void look(const cv::Mat& picture, double, const Message& asked, const vision::CameraView&, Message& answer) override {
        const double *at = asked.floats.data() + asked.floats.size() - 2, u = at[0], v = at[1];
        const auto colour = colourOf(asked.text);
        const auto disk = vision::findDisk(blobs(picture), colour, {u, v}, radius_, error_);
        auto refuse = [&](const std::string& why) { fail(kDisk, name(), vision::kColourNames[colour], u, v, why); };
        if (drawing_) drawing_->circle(u, v, radius_, vision::Drawing::note), drawing_->cross(u, v, vision::Drawing::note);
        if (!disk.blob) refuse("nothing in the picture has that colour");
        const auto& b = *disk.blob;
        if (drawing_) drawing_->cross(b.u, b.v, vision::Drawing::good);
        if (b.clipped) refuse("what fits best is cut off by the border of the picture");
        if (disk.fit < 0.1) refuse(fmt::format("what fits best is at {:.4g} {:.4g}, and fits {:.2g}", b.u, b.v, disk.fit));
        if (double part = b.area / disk.expectedArea; part < 0.6 || part > 1.5)
            refuse(fmt::format("what is there has {:.4g} pixels; a token has {:.4g}", b.area, disk.expectedArea));
        answer.floats = {b.u, b.v, b.area, disk.fit};
    }

private:
    std::uint8_t colourOf(const std::string& word) const {
        if (word.empty()) return vision::red;
        for (std::size_t c = vision::red; c < vision::kColours; ++c)
            if (word == vision::kColourNames[c]) return std::uint8_t(c);
        fail(kColour, name(), word);
    }
    double radius_ = 20, error_ = 5;
};

}  // namespace

extern "C" SORMA_EXPORT int Vision_Init(Tcl_Interp* interp) {
    std::vector<sorma::Class> classes{Hsvtable::describe(), FindBall::describe(), FindBrdMarker::describe(), GetBrdSit::describe(), GetDisk::describe()};
    for (auto& step : vision::steps()) classes.push_back(std::move(step));
    return sorma::provide(interp, "sorma::service::vision", "1.0", std::move(classes));
}
