/* The filter and the law of main.c as a node of ROS 2: it hears depth and attitude, and says the angle of stern planes.

   In a package of ament_cmake, next to the exported folder `dive`:
       find_package(ament_cmake REQUIRED) ... find_package(geometry_msgs REQUIRED)
       add_subdirectory(dive)
       add_executable(diver node.cpp)
       ament_target_dependencies(diver rclcpp std_msgs geometry_msgs)
       target_link_libraries(diver dive)
   rclcpp::spin calls all functions in one thread; with more threads each filter needs a lock. */
#include "dive.h"

#include <algorithm>
#include <chrono>
#include <geometry_msgs/msg/quaternion_stamped.hpp>
#include <memory>
#include <rclcpp/rclcpp.hpp>
#include <std_msgs/msg/float64.hpp>

using Attitude = geometry_msgs::msg::QuaternionStamped;
using Number = std_msgs::msg::Float64;

constexpr int STEPS = 2;
constexpr double DT = 0.05; /* s, of the exported filter's steps */

class Diver : public rclcpp::Node {
public:
    Diver() : Node("diver") {
        dive_reset(&filter_);
        before_ = depth();
        on_depth_ = create_subscription<Number>("depth", 10, [this](const Number &said) {
            check(dive_update_depth(&filter_, &said.data, nullptr), "depth");
        });
        on_attitude_ = create_subscription<Attitude>("attitude", 10, [this](const Attitude &said) {
            const double q[4] = {said.quaternion.w, said.quaternion.x, said.quaternion.y, said.quaternion.z};
            check(dive_update_attitude(&filter_, q, nullptr), "attitude");
        });
        planes_ = create_publisher<Number>("stern_planes", 10);
        timer_ = create_wall_timer(std::chrono::milliseconds(100), [this] { steer(); });
    }

private:
    void check(int code, const char *what) {
        if (code != DIVE_OK) RCLCPP_WARN(get_logger(), "%s failed with code %d", what, code);
    }

    double depth() const { /* the third component of q = R n */
        const double *R = filter_.row + DIVE_ROW_G, *n = filter_.row + DIVE_ROW_N;
        return R[6] * n[0] + R[7] * n[1] + R[8] * n[2];
    }

    void steer() {
        for (int i = 0; i < STEPS; i++) check(dive_predict(&filter_, DT), "prediction");
        const double now = depth(), sink = (now - before_) / (STEPS * DT);
        before_ = now;
        Number angle;
        angle.data = std::clamp(0.3 * (4.0 - now) - 0.6 * sink, -0.2, 0.2);
        filter_.inputs[DIVE_INPUT_STERN_PLANES] = angle.data;
        planes_->publish(angle);
    }

    dive filter_;
    double before_;
    rclcpp::Subscription<Number>::SharedPtr on_depth_;
    rclcpp::Subscription<Attitude>::SharedPtr on_attitude_;
    rclcpp::Publisher<Number>::SharedPtr planes_;
    rclcpp::TimerBase::SharedPtr timer_;
};

int main(int count, char **words) {
    rclcpp::init(count, words);
    rclcpp::spin(std::make_shared<Diver>());
    rclcpp::shutdown();
}
