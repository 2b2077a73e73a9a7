// painter -- draws what a camera above a draughts board would see, for the tests of vision: as a record of camera.image.
//
// It has its own way from the world to the picture: nothing of what is tested is used here. Colours are those of the laboratory's
// scene, with light and noise as asked for.
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include <sorma.h>

namespace {

const sorma::Prototype kSymbols{sorma::Severity::error, "PAINTER SYMBOLS", 1, "{}: -symbols has {} characters; it must be 64"};

constexpr int kFine = 2;            // drawn so many times larger, and then made smaller: edges are smooth
enum Label { background, red, yellow, violet };

class Painter : public sorma::Service {
public:
    static sorma::Class describe() {
        return sorma::Class::of<Painter>("painter", "draws what a camera above a draughts board would see")
            .text("-symbols", &Painter::symbols_, {.help = "64 characters of .ry, rank 8 first"})
            .vector("-board", &Painter::board_, {.help = "x y [m] yaw [rad]", .minLength = 3, .maxLength = 3})
            .vector("-at", &Painter::at_, {.help = "position and quaternion of the tool", .minLength = 7, .maxLength = 7})
            .vector("-size", &Painter::size_, {.unit = "pixels", .low = 1, .high = 2000, .help = "width, height", .minLength = 2, .maxLength = 2})
            .real("-light", &Painter::light_, {.low = 0, .high = 3, .help = "factor of all colours"})
            .real("-noise", &Painter::noise_, {.low = 0, .high = 50, .help = "standard deviation of each value"})
            .real("-scatter", &Painter::scatter_, {.unit = "m", .low = 0, .high = 0.1, .help = "how far tokens may be off the middle of their fields"})
            .vector("-extra", &Painter::extra_, {.help = "more discs: x y (board) radius [m] label, ...", .minLength = 0, .maxLength = 40})
            .vector("-hide", &Painter::hide_, {.unit = "pixels", .help = "u v radius of a dark disc before all", .minLength = 0, .maxLength = 3})
            .vector("-ball", &Painter::ball_, {.unit = "m", .help = "x y z radius, in the camera's frame", .minLength = 0, .maxLength = 4})
            .vector("-stain", &Painter::stain_, {.unit = "pixels", .help = "u v radius of a white disc", .minLength = 0, .maxLength = 3})
            .integer("-seed", &Painter::seed_, {.help = "of noise and scatter"})
            .words("?labelled?");
    }

    void exec(sorma::Message& m) override {
        if (symbols_.size() != 64) fail(kSymbols, name(), symbols_.size());
        const bool labelled = !m.words.empty();
        const int w = int(size_[0]), h = int(size_[1]);
        random_.seed(std::uint32_t(seed_) + std::uint32_t(++pictures_) * 7919);
        focus_ = h / (2 * std::tan(1.0122909661567112 / 2));
        camera_ = Eigen::Translation3d(at_[0], at_[1], at_[2]) * Eigen::Quaterniond(at_[3], at_[4], at_[5], at_[6]) * Eigen::Translation3d(0.115, 0, -0.150);
        // x right, y down, z forward; 12 degrees towards the axis.
        Eigen::Matrix3d tilt;
        tilt << 0, -0.97814760, -0.20791169, 1, 0, 0, 0, -0.20791169, 0.97814760;
        camera_.linear() = camera_.linear() * tilt;
        picture_ = cv::Mat(kFine * h, kFine * w, CV_8UC3, cv::Scalar(150, 146, 138));
        labels_ = cv::Mat::zeros(kFine * h, kFine * w, CV_8U);
        square(0, 0, 0.192, {226, 219, 195});
        for (int rank = 0; rank < 8; ++rank)
            for (int file = 0; file < 8; ++file)
                if ((rank + file) % 2 == 0) square((3.5 - rank) * 0.045, (file - 3.5) * 0.045, 0.0225, {64, 107, 64});
        disc(-0.206, -0.160, 0.0005, 0.013, violet);
        disc(-0.206, 0.160, 0.0005, 0.009, violet);
        std::uniform_real_distribution<double> off(-scatter_, scatter_);
        for (int i = 0; i < 64; ++i) {
            if (symbols_[std::size_t(i)] == '.') continue;
            double x = (i / 8 - 3.5) * 0.045 + off(random_), y = (i % 8 - 3.5) * 0.045 + off(random_);
            token(x, y, 0.015, symbols_[std::size_t(i)] == 'r' ? red : yellow);
        }
        for (std::size_t i = 0; i + 3 < extra_.size(); i += 4) token(extra_[i], extra_[i + 1], extra_[i + 2], Label(int(extra_[i + 3])));
        cv::Mat small;
        picture_.convertTo(picture_, -1, light_);
        if (hide_.size() == 3) spot(hide_, cv::Scalar(20, 20, 20));
        if (ball_.size() == 4) paintBall();
        if (stain_.size() == 3) spot(stain_, cv::Scalar(255, 255, 255));
        cv::resize(picture_, small, {w, h}, 0, 0, cv::INTER_AREA);
        if (noise_ > 0) {
            std::normal_distribution<double> grain(0, noise_);
            for (int y = 0; y < h; ++y)
                for (int k = 0; k < 3 * w; ++k) small.ptr(y)[k] = cv::saturate_cast<std::uint8_t>(small.ptr(y)[k] + grain(random_));
        }
        m.clear();
        m.floats = {double(pictures_) / 20, double(w), double(h), 0, 0};
        m.any.assign(small.data, small.data + small.total() * 3);
        if (labelled) {
            cv::resize(labels_, labels_, {w, h}, 0, 0, cv::INTER_NEAREST);
            m.any.insert(m.any.end(), labels_.data, labels_.data + labels_.total());
        }
    }

private:
    static cv::Scalar colourOf(Label l) {
        return l == red ? cv::Scalar(204, 15, 10) : l == yellow ? cv::Scalar(242, 204, 13) : cv::Scalar(128, 13, 191);
    }

    cv::Point2d project(double x, double y, double z) const {
        double c = std::cos(board_[2]), s = std::sin(board_[2]);
        Eigen::Vector3d p = camera_.inverse() * Eigen::Vector3d(board_[0] + c * x - s * y, board_[1] + s * x + c * y, z);
        // The middle of a pixel is a whole number: it covers half a pixel to each side.
        return {size_[0] / 2 + focus_ * p.x() / p.z(), size_[1] / 2 + focus_ * p.y() / p.z()};
    }

    void fill(const std::vector<cv::Point2d>& corners, const cv::Scalar& colour, int label) {
        std::vector<cv::Point> points;
        for (auto& c : corners) points.emplace_back(int(std::lround((c.x * kFine - 0.5) * 256)), int(std::lround((c.y * kFine - 0.5) * 256)));
        const std::vector<std::vector<cv::Point>> all{points};
        cv::fillPoly(picture_, all, colour, cv::LINE_8, 8);
        cv::fillPoly(labels_, all, label, cv::LINE_8, 8);
    }
    void square(double x, double y, double half, const cv::Scalar& colour) {
        fill({project(x - half, y - half, 0), project(x + half, y - half, 0), project(x + half, y + half, 0), project(x - half, y + half, 0)}, colour, background);
    }
    void disc(double x, double y, double z, double radius, Label label, double shade = 1) {
        std::vector<cv::Point2d> rim;
        for (int k = 0; k < 48; ++k) {
            double t = 2 * std::numbers::pi * k / 48;
            rim.push_back(project(x + radius * std::cos(t), y + radius * std::sin(t), z));
        }
        fill(rim, colourOf(label) * shade, label);
    }
    // Its side, darker, and its top.
    void token(double x, double y, double radius, Label label) {
        for (double z = 0; z < 0.0079; z += 0.001) disc(x, y, z, radius, label, 0.8);
        disc(x, y, 0.008, radius, label);
    }
    void spot(const std::vector<double>& at, const cv::Scalar& colour) {
        cv::circle(picture_, cv::Point(int((at[0] + 0.5) * kFine), int((at[1] + 0.5) * kFine)), int(at[2] * kFine), colour, -1);
    }
    // Where the ray through a point of the picture meets the ball.
    void paintBall() {
        Eigen::Vector3d centre(ball_[0], ball_[1], ball_[2]);
        for (int v = 0; v < picture_.rows; ++v)
            for (int u = 0; u < picture_.cols; ++u) {
                Eigen::Vector3d ray((double(u) + 0.5) / kFine - size_[0] / 2, (double(v) + 0.5) / kFine - size_[1] / 2, focus_);
                double along = ray.normalized().dot(centre);
                if (along > 0 && centre.squaredNorm() - along * along <= ball_[3] * ball_[3]) picture_.at<cv::Vec3b>(v, u) = {255, 255, 255};
            }
    }

    std::string symbols_ = std::string(64, '.');
    std::vector<double> board_{0.57, 0, 0}, at_{0.57, 0, 0.45, 0, 1, 0, 0}, size_{500, 500}, extra_, hide_, ball_, stain_;
    double light_ = 1, noise_ = 0, scatter_ = 0, focus_ = 0;
    std::int64_t seed_ = 1, pictures_ = 0;
    Eigen::Isometry3d camera_;
    cv::Mat picture_, labels_;
    std::mt19937 random_;
};

}  // namespace

extern "C" SORMA_EXPORT int Painter_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::painter", "1.0", {Painter::describe()});
}
