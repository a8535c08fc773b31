#pragma once
namespace geometry_msgs::msg {
struct Quaternion {
    double x, y, z, w;
};
struct QuaternionStamped {
    Quaternion quaternion;
};
}  // namespace geometry_msgs::msg
