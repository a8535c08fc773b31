"""Symmetric compositions with known coefficients, of orders 4 to 10 (mathematics: section 7)."""

from __future__ import annotations

from dataclasses import dataclass

from coadjoint.errors import ArgumentError, must_give
from coadjoint.methods.composition import Composition, NegativeSubsteps
from coadjoint.methods.method import Method, Start


@dataclass(frozen=True, init=False)
class _Scheme(Composition):
    """A composition of known coefficients over a symmetric method of order 2; `first`: those up to the middle one."""

    def __init__(self, base: Method, start: Start | None = None, negative_substeps: NegativeSubsteps = "refuse"):
        if not isinstance(base, Method) or base.order != 2 or not base.symmetric:
            if isinstance(base, type):
                raise ArgumentError(f"{type(self).__name__} needs a method, but got a class: write {base.__name__}().")
            raise ArgumentError(
                f"{type(self).__name__} needs a symmetric method of order 2, as in co.Suzuki4(co.Midpoint()), "
                f"but got {base!r}; one of your own says so by `symmetric` and `order`, as co.Variational(symmetric="
                "True) does, and co.methods.Symmetrised(method) makes one."
            )
        super().__init__(base, _mirrored(self.first), start=start, negative_substeps=negative_substeps)

    @property
    def first(self) -> tuple[float, ...]:
        """γ_1 … up to the one before the middle, which makes the sum 1."""
        must_give(self, "first")


def _mirrored(first: tuple[float, ...]) -> tuple[float, ...]:
    return (*first, 1 - 2 * sum(first), *reversed(first))


class Suzuki4(_Scheme):
    """Five steps (γ, γ, 1 − 4γ, γ, γ)h, γ = 1/(4 − 4^{1/3}): order 4.

    Source: Suzuki, Phys. Lett. A 146 (1990) 319.
    """

    @property
    def first(self) -> tuple[float, ...]:
        return (1 / (4 - 4 ** (1 / 3)),) * 2


class Yoshida4(_Scheme):
    """Three steps (γ, 1 − 2γ, γ)h, γ = 1/(2 − 2^{1/3}): order 4, with an error some 65 times that of `Suzuki4`.

    Source: Yoshida, Phys. Lett. A 150 (1990) 262.
    """

    @property
    def first(self) -> tuple[float, ...]:
        return (1 / (2 - 2 ** (1 / 3)),)


class KahanLi6(_Scheme):
    """Nine steps, order 6. Source: Kahan and Li, Math. Comp. 66 (1997) 1089, s9odr6a."""

    @property
    def first(self) -> tuple[float, ...]:
        return (
            0.39216144400731413927925056, 0.33259913678935943859974864,
            -0.70624617255763935980996482, 0.08221359629355080023149045,
        )  # fmt: skip


class KahanLi8(_Scheme):
    """Seventeen steps, order 8. Source: Kahan and Li, Math. Comp. 66 (1997) 1089, s17odr8a."""

    @property
    def first(self) -> tuple[float, ...]:
        return (
            0.13020248308889008087881763, 0.56116298177510838456196441,
            -0.38947496264484728640807860, 0.15884190655515560089621075,
            -0.39590389413323757733623154, 0.18453964097831570709183254,
            0.25837438768632204729397911, 0.29501172360931029887096624,
        )  # fmt: skip


class SofroniouSpaletta6(_Scheme):
    """Thirteen steps, order 6, with a smaller error at equal work than nine.

    Source: Sofroniou and Spaletta, Optim. Methods Softw. 20 (2005) 597.
    """

    @property
    def first(self) -> tuple[float, ...]:
        return (
            0.13861930854051695245808013042625, 0.13346562851074760407046858832209,
            0.13070531011449225190542755785015, 0.12961893756907034772505366537091,
            -0.35000324893920896516170830911323, 0.11805530653002387170273438954049,
        )  # fmt: skip


class SofroniouSpaletta8(_Scheme):
    """Twenty-one steps, order 8. Source: Sofroniou and Spaletta, Optim. Methods Softw. 20 (2005) 597."""

    @property
    def first(self) -> tuple[float, ...]:
        return (
            0.10647728984550031823931967854896, 0.10837408645835726397433410591546,
            0.35337821052654342419534541324080, -0.23341414023165082198780281128319,
            -0.24445266791528841269462171413216, 0.11317848435755633314700952515599,
            0.11892905625000350062692972283951, 0.12603912321825988140305670268365,
            0.12581718736176041804392391641587, 0.11699135019217642180722881433533,
        )  # fmt: skip


class SofroniouSpaletta10(_Scheme):
    """Thirty-five steps, order 10. Source: Sofroniou and Spaletta, Optim. Methods Softw. 20 (2005) 597."""

    @property
    def first(self) -> tuple[float, ...]:
        return (
            0.078795722521686419263907679337684, 0.31309610341510852776481247192647,
            0.027918383235078066109520273275299, -0.22959284159390709415121339679655,
            0.13096206107716486317465685927961, -0.26973340565451071434460973222411,
            0.074973343155891435666137105641410, 0.11199342399981020488957508073640,
            0.36613344954622675119314812353150, -0.39910563013603589787862981058340,
            0.10308739852747107731580277001372, 0.41143087395589023782070411897608,
            -0.0048663605831352617621956593099771, -0.39203335370863990644808193642610,
            0.051942502962449647037182904015976, 0.050665090759924496335874344156866,
            0.049674370639729879054568800279461,
        )  # fmt: skip
