/* As much of rclcpp as examples/robot/node.cpp uses, for a test without ROS 2: spin plays 20 periods of a still vehicle. */
#pragma once
#include <chrono>
#include <cstdio>
#include <functional>
#include <geometry_msgs/msg/quaternion_stamped.hpp>
#include <memory>
#include <std_msgs/msg/float64.hpp>
#include <string>

#define RCLCPP_WARN(logger, ...) std::printf("warning: "), std::printf(__VA_ARGS__), std::printf("\n")

namespace rclcpp {
struct Logger {};
template <class M> struct Subscription {
    using SharedPtr = std::shared_ptr<Subscription>;
    std::function<void(const M &)> call;
};
template <class M> struct Publisher {
    using SharedPtr = std::shared_ptr<Publisher>;
    void publish(const M &said) { std::printf("%.17g\n", said.data); }
};
struct TimerBase {
    using SharedPtr = std::shared_ptr<TimerBase>;
    std::function<void()> call;
};
inline std::function<void(const std_msgs::msg::Float64 &)> depth;
inline std::function<void(const geometry_msgs::msg::QuaternionStamped &)> attitude;
inline std::function<void()> tick;
inline void keep(std::function<void(const std_msgs::msg::Float64 &)> call) { depth = call; }
inline void keep(std::function<void(const geometry_msgs::msg::QuaternionStamped &)> call) { attitude = call; }

class Node {
public:
    explicit Node(const std::string &) {}
    template <class M, class F>
    typename Subscription<M>::SharedPtr create_subscription(const std::string &, int, F &&call) {
        keep(std::function<void(const M &)>(call));
        return std::make_shared<Subscription<M>>();
    }
    template <class M> typename Publisher<M>::SharedPtr create_publisher(const std::string &, int) {
        return std::make_shared<Publisher<M>>();
    }
    template <class R, class P, class F>
    TimerBase::SharedPtr create_wall_timer(std::chrono::duration<R, P>, F &&call) {
        tick = call;
        return std::make_shared<TimerBase>();
    }
    Logger get_logger() const { return {}; }
};

inline void init(int, char **) {}
inline void shutdown() {}
inline void spin(std::shared_ptr<Node>) {
    for (int k = 0; k < 20; k++) {
        depth({3.0 + 0.001 * k});
        attitude({{0.0, 0.0, 0.0, 1.0}});
        tick();
    }
    depth({0.0 / 0.0});
}
}  // namespace rclcpp
