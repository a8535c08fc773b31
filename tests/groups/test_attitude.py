"""Attitudes: what each parametrisation must give back, against finite differences and against SciPy."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from coadjoint.groups import attitude

ROUND_OFF = 1e-14
HALF = np.pi / 2


@pytest.fixture(params=[1, 2025])
def random(request):
    print(f"seed {request.param}")
    return np.random.default_rng(request.param)


def rotations(random, count=500):
    return Rotation.random(count, rng=random).as_matrix()


def angles(random, *shape):
    return random.uniform(-2 * np.pi, 2 * np.pi, (3, *shape))


def slope(path, step=1e-3):
    """d/dt path(t) at t = 0, the error of order step⁴."""
    return (8 * (path(step) - path(-step)) - (path(2 * step) - path(-2 * step))) / (12 * step)


def vee(matrix):
    return np.stack([matrix[..., 2, 1], matrix[..., 0, 2], matrix[..., 1, 0]], axis=-1)


def body_velocity(path):
    """(RᵀṘ)ᵛ along a path of rotation matrices at t = 0."""
    return vee(np.swapaxes(path(0.0), -1, -2) @ slope(path))


EULER = [
    pytest.param("ZXZ", attitude.zxz, attitude.zxz_angles, id="zxz"),
    pytest.param("ZYX", attitude.zyx, attitude.zyx_angles, id="zyx"),
]
EULER_RATES = [
    pytest.param(attitude.zxz, attitude.zxz_angular_velocity, attitude.zxz_rates, id="zxz"),
    pytest.param(attitude.zyx, attitude.zyx_angular_velocity, attitude.zyx_rates, id="zyx"),
]


def test_paper_initial_attitude_is_the_identity_with_its_angular_velocity():
    start = (2 * np.pi, 0.0, 2 * np.pi)
    omega = attitude.zxz_angular_velocity(*start, np.radians([10, 10, 10]))
    np.testing.assert_allclose(attitude.zxz(*start), np.eye(3), atol=ROUND_OFF)
    np.testing.assert_allclose(omega, np.radians([10, 0, 20]), atol=ROUND_OFF)


def test_zyx_positive_angles_turn_the_bow_as_seamen_say():
    """z down: yaw takes the bow from north to east, pitch lifts it, roll puts starboard (y) down."""
    bow, starboard = np.eye(3)[:2]
    assert (attitude.zyx(0.1, 0, 0) @ bow)[1] > 0
    assert (attitude.zyx(0, 0.1, 0) @ bow)[2] < 0
    assert (attitude.zyx(0, 0, 0.1) @ starboard)[2] > 0


@pytest.mark.parametrize(("sequence", "matrix", "back"), EULER)
def test_euler_matrix_agrees_with_scipy(random, sequence, matrix, back):
    given = angles(random, 500)
    np.testing.assert_allclose(matrix(*given), Rotation.from_euler(sequence, given.T).as_matrix(), atol=ROUND_OFF)


@pytest.mark.parametrize(("sequence", "matrix", "back"), EULER)
def test_euler_angles_reproduce_random_rotations_and_agree_with_scipy(random, sequence, matrix, back):
    R = rotations(random)
    found = back(R)
    np.testing.assert_allclose(matrix(*found), R, atol=ROUND_OFF)
    difference = np.stack(found, axis=-1) - Rotation.from_matrix(R).as_euler(sequence)
    np.testing.assert_allclose(np.exp(1j * difference), 1.0, atol=1e-12)


@pytest.mark.parametrize(("sequence", "matrix", "back"), EULER)
@pytest.mark.parametrize("offset", [0.0, 1e-16, 1e-13, 1e-11, 1e-8, 1e-4])
def test_euler_angles_reproduce_rotations_at_and_near_both_singular_attitudes(random, sequence, matrix, back, offset):
    first, _, last = angles(random, 200)
    for singular in (0.0, np.pi) if sequence == "ZXZ" else (-HALF, HALF):
        for middle in (singular + offset, singular - offset):
            R = matrix(first, middle, last)
            lost = offset if offset <= 1e-12 else 0.0  # the documented limit
            np.testing.assert_allclose(matrix(*back(R)), R, atol=ROUND_OFF + 2 * lost)


@pytest.mark.parametrize(
    ("kind", "middle", "sign"), [("zxz", 0.0, 1), ("zxz", np.pi, -1), ("zyx", HALF, -1), ("zyx", -HALF, 1)]
)
def test_angles_without_nutation_or_in_gimbal_lock_give_the_turn_to_the_first(kind, middle, sign):
    R = getattr(attitude, kind)(0.7, middle, 0.4)
    first, found, last = getattr(attitude, f"{kind}_angles")(R)
    np.testing.assert_allclose([first, found, last], [0.7 + sign * 0.4, middle, 0.0], atol=ROUND_OFF)
    assert last == 0.0


def test_heading_of_exactly_pi_reads_plus_pi():
    south = np.diag([-1.0, -1.0, 1.0])
    assert attitude.zyx_angles(south)[0] == np.pi
    assert attitude.zxz_angles(south)[0] == np.pi


@pytest.mark.parametrize(("matrix", "velocity", "back"), EULER_RATES)
def test_angular_velocity_is_the_derivative_of_the_angle_path(random, matrix, velocity, back):
    given, rates = angles(random, 200), random.normal(size=(3, 200))
    expected = body_velocity(lambda t: matrix(*(given + t * rates)))
    np.testing.assert_allclose(velocity(*given, rates.T), expected, atol=1e-9)


@pytest.mark.parametrize(("matrix", "velocity", "back"), EULER_RATES)
def test_euler_rates_invert_angular_velocity(random, matrix, velocity, back):
    first, last = random.uniform(-np.pi, np.pi, (2, 200))
    middle = random.uniform(0.1, 1.4, 200)
    omega = random.normal(size=(200, 3))
    found = velocity(first, middle, last, back(first, middle, last, omega))
    np.testing.assert_allclose(found, omega, atol=1e-13)


@pytest.mark.parametrize("turns", [0.0, 1.0, -1.0, 2.0])
def test_rates_refuse_zero_nutation_and_gimbal_lock(turns):
    with pytest.raises(ValueError, match=r"`theta` must keep away from 0 and π.*\|sin θ\|"):
        attitude.zxz_rates(0.1, [1.0, turns * np.pi], 0.2, [1, 2, 3])
    with pytest.raises(ValueError, match=r"`pitch` must keep away from ±π/2.*\|cos pitch\|"):
        attitude.zyx_rates(0.1, [1.0, HALF + turns * np.pi], 0.2, [1, 2, 3])


def test_quaternion_reproduces_random_rotations_and_agrees_with_scipy(random):
    R = rotations(random)
    q = attitude.to_quaternion(R)
    scipy = Rotation.from_matrix(R).as_quat(canonical=True, scalar_first=True)
    np.testing.assert_allclose(attitude.from_quaternion(q), R, atol=ROUND_OFF)
    np.testing.assert_allclose(q, scipy, atol=ROUND_OFF)
    assert np.all(q[:, 0] >= 0)


def test_quaternion_double_cover_gives_one_rotation_and_comes_back_with_positive_scalar(random):
    q = random.normal(size=(500, 4))
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    np.testing.assert_array_equal(attitude.from_quaternion(q), attitude.from_quaternion(-q))
    expected = q * np.sign(q[:, :1])
    np.testing.assert_allclose(attitude.to_quaternion(attitude.from_quaternion(-q)), expected, atol=ROUND_OFF)


def test_quaternions_compose_like_matrices(random):
    p, q = attitude.to_quaternion(rotations(random, 2))
    scalar = p[0] * q[0] - p[1:] @ q[1:]
    product = [scalar, *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))]
    composed = attitude.from_quaternion(p) @ attitude.from_quaternion(q)
    np.testing.assert_allclose(attitude.from_quaternion(product), composed, atol=ROUND_OFF)


@pytest.mark.parametrize("deficit", [0.0, 1e-15, 1e-12, 1e-8, 1e-4])
@pytest.mark.parametrize("axis", [[1, 0, 0], [0, -1, 0], [0, 0, 1], [3, -4, 0], [1, 1, -1], [1e-9, 1, -1e-5]])
def test_quaternion_and_rotation_vector_lose_nothing_at_angle_pi(axis, deficit):
    unit = np.array(axis) / np.linalg.norm(axis)
    vector = (np.pi - deficit) * unit
    R = Rotation.from_rotvec(vector).as_matrix()
    np.testing.assert_allclose(attitude.from_rotation_vector(vector), R, atol=ROUND_OFF)
    np.testing.assert_allclose(attitude.from_quaternion(attitude.to_quaternion(R)), R, atol=ROUND_OFF)
    found = attitude.rotation_vector(R)
    np.testing.assert_allclose(np.linalg.norm(found), np.pi - deficit, atol=ROUND_OFF)
    np.testing.assert_allclose(attitude.from_rotation_vector(found), R, atol=ROUND_OFF)
    if deficit >= 1e-12:  # nearer to π the sign is round-off's
        np.testing.assert_allclose(found, vector, atol=ROUND_OFF)


def test_half_turn_given_exactly_has_its_largest_axis_component_positive():
    np.testing.assert_array_equal(attitude.rotation_vector(np.diag([-1.0, 1, -1])), [0, np.pi, 0])
    unit = np.array([0.6, -0.8, 0.0])
    half_turn = 2 * np.outer(unit, unit) - np.eye(3)
    np.testing.assert_allclose(attitude.to_quaternion(half_turn), [0, -0.6, 0.8, 0], atol=ROUND_OFF)


def test_rotation_vector_inverts_the_exponential_and_agrees_with_scipy(random):
    unit = random.normal(size=(500, 3))
    unit /= np.linalg.norm(unit, axis=-1, keepdims=True)
    vector = random.uniform(0, 3.1, (500, 1)) * unit
    R = attitude.from_rotation_vector(vector)
    np.testing.assert_allclose(R, Rotation.from_rotvec(vector).as_matrix(), atol=ROUND_OFF)
    np.testing.assert_allclose(attitude.rotation_vector(R), vector, atol=1e-13)


@pytest.mark.parametrize("size", [1e-3, 1e-8, 1e-20, 1e-200, 0.0])
def test_rotation_vector_keeps_relative_accuracy_for_small_rotations(size):
    vector = size * np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(attitude.rotation_vector(attitude.from_rotation_vector(vector)), vector, rtol=1e-14)


def test_quaternion_rates_are_the_derivative_along_a_constant_angular_velocity(random):
    q, omega = attitude.to_quaternion(rotations(random, 200)), random.normal(size=(200, 3))

    def path(t):
        turned = attitude.to_quaternion(attitude.from_quaternion(q) @ attitude.from_rotation_vector(t * omega))
        return turned * np.sign(np.sum(turned * q, axis=-1, keepdims=True))

    rates = attitude.quaternion_rates(q, omega)
    np.testing.assert_allclose(rates, slope(path), atol=1e-10)
    np.testing.assert_allclose(attitude.quaternion_angular_velocity(q, rates), omega, atol=ROUND_OFF)
    np.testing.assert_allclose(attitude.quaternion_angular_velocity(q, rates + 7 * q), omega, atol=1e-13)


def test_every_function_keeps_leading_axes(random):
    first, middle, last = random.uniform(0.1, 1, 4), random.uniform(0.1, 1, (5, 1)), 0.3
    omega = random.normal(size=(4, 3))
    R = attitude.zyx(first, middle, last)
    assert R.shape == (5, 4, 3, 3)
    q = attitude.to_quaternion(R)
    for vector in (
        attitude.rotation_vector(R),
        attitude.zxz_angular_velocity(first, middle, last, omega),
        attitude.zyx_angular_velocity(first, middle, last, omega),
        attitude.zxz_rates(first, middle, last, omega),
        attitude.zyx_rates(first, middle, last, omega),
        attitude.quaternion_angular_velocity(q, attitude.quaternion_rates(q, omega)),
    ):
        assert vector.shape == (5, 4, 3)
        assert vector.dtype == np.float64
    expected = attitude.zyx_rates(first[2], middle[3, 0], last, omega[2])
    np.testing.assert_allclose(attitude.zyx_rates(first, middle, last, omega)[3, 2], expected, rtol=1e-14)
    assert attitude.zxz_rates(0.1, 0.2, 0.3, omega).shape == (4, 3)
    assert attitude.to_quaternion(np.empty((0, 3, 3))).shape == (0, 4)
    assert attitude.from_quaternion(np.empty((0, 4))).shape == (0, 3, 3)


@pytest.mark.parametrize("function", [attitude.zxz_angles, attitude.zyx_angles, attitude.to_quaternion])
def test_what_is_no_rotation_matrix_is_refused_in_one_sentence(function):
    with pytest.raises(ValueError, match=r"but RᵀR − I reaches 0\.21; project it first\."):
        function(np.diag([1.1, 1, 1]))
    with pytest.raises(ValueError, match="its determinant is −1"):
        function(np.diag([1.0, 1, -1]))
    with pytest.raises(ValueError, match=r"`R` must have last axes \(3, 3\), but its shape is \(3,\)"):
        function([1, 2, 3])
    with pytest.raises(ValueError, match="`R` must be finite, but holds nan"):
        function(np.full((3, 3), np.nan))


def test_arguments_that_cannot_be_meant_are_refused_by_name():
    with pytest.raises(ValueError, match=r"`quaternion` must have length 1, but has 2;"):
        attitude.from_quaternion([[1, 0, 0, 0], [2, 0, 0, 0]])
    with pytest.raises(ValueError, match=r"`quaternion` must have last axes \(4,\)"):
        attitude.from_quaternion([1, 0, 0])
    with pytest.raises(ValueError, match="`pitch` must be finite, but holds inf"):
        attitude.zyx(0, np.inf, 0)
    with pytest.raises(ValueError, match=r"`psi`, `theta`, `phi` must broadcast.*\(2,\), \(3,\), \(\)"):
        attitude.zxz([0, 0], [0, 0, 0], 0)
    with pytest.raises(ValueError, match="`quaternion`, `omega` must broadcast"):
        attitude.quaternion_rates([[1, 0, 0, 0]] * 2, np.zeros((3, 3)))
    with pytest.raises(ValueError, match="`omega` must broadcast"):
        attitude.zyx_rates([0, 0], 0, 0, np.zeros((3, 3)))


def imports_jax(statement):
    code = f"import sys; {statement}; sys.exit('jax' in sys.modules)"
    return subprocess.run([sys.executable, "-c", code], check=False, timeout=120).returncode != 0


def test_the_file_itself_needs_no_jax():
    assert not imports_jax(f"import runpy; runpy.run_path({attitude.__file__!r})")
