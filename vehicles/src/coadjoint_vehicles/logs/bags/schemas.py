"""The definitions of the messages of ROS 2 that are written: those of its common interfaces."""

from __future__ import annotations

from collections.abc import Iterable

from coadjoint_vehicles.logs.bags.definitions import NUMBERS, STRING, Definition, definition, short

_STAMPED = "std_msgs/Header header\n"
BODIES = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "std_msgs/Float64": "float64 data\n",
    "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride\n",
    "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n",
    "std_msgs/Float64MultiArray": "std_msgs/MultiArrayLayout layout\nfloat64[] data\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance\n",
    "geometry_msgs/PoseWithCovarianceStamped": f"{_STAMPED}geometry_msgs/PoseWithCovariance pose\n",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist\nfloat64[36] covariance\n",
    "geometry_msgs/TwistWithCovarianceStamped": f"{_STAMPED}geometry_msgs/TwistWithCovariance twist\n",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
    "geometry_msgs/TransformStamped": f"{_STAMPED}string child_frame_id\ngeometry_msgs/Transform transform\n",
    "geometry_msgs/Vector3Stamped": f"{_STAMPED}geometry_msgs/Vector3 vector\n",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "nav_msgs/Odometry": f"{_STAMPED}string child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
    "geometry_msgs/TwistWithCovariance twist\n",
    "sensor_msgs/Imu": f"{_STAMPED}geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
    "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
    "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
    "sensor_msgs/FluidPressure": f"{_STAMPED}float64 fluid_pressure\nfloat64 variance\n",
    "sensor_msgs/NavSatStatus": "int8 STATUS_NO_FIX=-1\nint8 STATUS_FIX=0\nint8 STATUS_SBAS_FIX=1\n"
    "int8 STATUS_GBAS_FIX=2\nint8 status\nuint16 SERVICE_GPS=1\nuint16 SERVICE_GLONASS=2\nuint16 SERVICE_COMPASS=4\n"
    "uint16 SERVICE_GALILEO=8\nuint16 service\n",
    "sensor_msgs/NavSatFix": f"{_STAMPED}sensor_msgs/NavSatStatus status\nfloat64 latitude\nfloat64 longitude\n"
    "float64 altitude\nfloat64[9] position_covariance\nuint8 COVARIANCE_TYPE_UNKNOWN=0\n"
    "uint8 COVARIANCE_TYPE_APPROXIMATED=1\nuint8 COVARIANCE_TYPE_DIAGONAL_KNOWN=2\nuint8 COVARIANCE_TYPE_KNOWN=3\n"
    "uint8 position_covariance_type\n",
}
"""The text of each type without those inside."""
PACKAGE = "coadjoint_msgs"
"""That of types such as `coadjoint_msgs/DvlBeams`, of sensors that ROS has no type for; SI units and rad."""


def stamped(fields: Iterable[str]) -> str:
    """The definition of a type of numbers under these names, behind a header."""
    return _STAMPED + "".join(f"float64 {name}\n" for name in fields)


_LINE = "=" * 80


def schema(name: str, body: str | None = None) -> str:
    """The text of a type, `pkg/Name`, with those of all types inside, as MCAP files hold it.

    body: its definition, if it is not one of `BODIES`.
    """
    body = BODIES[name] if body is None else body
    inside: list[str] = []

    def gather(text: str) -> None:
        for line in text.splitlines():
            kind = line.split()[0].partition("[")[0]
            if kind not in NUMBERS and kind != STRING and kind not in inside:
                inside.append(kind)
                gather(BODIES[kind])

    gather(body)
    return body + "".join(f"{_LINE}\nMSG: {kind}\n{BODIES[kind]}" for kind in inside)


def known(name: str, body: str | None = None) -> Definition:
    """The definition of a type that is written; `body` as for `schema`."""
    return definition(name, schema(short(name), body), name)
