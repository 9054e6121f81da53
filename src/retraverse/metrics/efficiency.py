"""What an answer costs in time and data, and precision weighed against it.

Conventions: times in seconds; ``t_e`` encodes one frame, ``t_m`` matches one query (or window)
against the *whole* map, ``t_c`` compresses one frame. VPR-Bench publishes its matching times per
reference: multiply them by the number of references first.
"""

import math

from retraverse.errors import InputError

__all__ = ["data_volume", "performance_per_compute_unit", "t_total", "t_vpr"]


def performance_per_compute_unit(p_r100: float, *, t_e: float, t_e_max: float) -> float:
    """Return P_R100 x log10(t_e_max / t_e + 9) (PCU; equation 2.4 of the thesis).

    Parameters
    ----------
    p_r100 : float in [0, 1]
        Precision at full recall: `precision_at_full_recall` of the "thesis" curve.
    t_e : float
        Encoding time in seconds. For sequences K times one frame's; where K is dynamic, the mean K.
    t_e_max : float
        Encoding time in seconds of the slowest technique compared, which then scores its P_R100.

    Returns
    -------
    float
        At least 0. Above `p_r100` for faster techniques. Where t_e exceeds t_e_max, as it may for
        sequences, the formula is applied as it stands and the result lies below `p_r100`.

    Raises
    ------
    InputError
        If a time is not a positive number, or `p_r100` is outside [0, 1].

    Notes
    -----
    The thesis prints "log"; the published values take the base 10, with which the slowest
    technique's factor is log10(10) = 1.
    """
    if not 0 <= p_r100 <= 1:
        raise InputError(f"p_r100: got {p_r100}, expected 0 to 1 (a percentage?)")
    _positive(t_e=t_e, t_e_max=t_e_max)
    return p_r100 * math.log10(t_e_max / t_e + 9)


def t_vpr(t_e: float, t_m: float, sequence_length: float = 1) -> float:
    """Return the seconds one answer takes, t_e K + t_m (equations 4.7, 6.2, 6.3 and 7.1).

    `sequence_length` is K, or the mean K where it is dynamic. A live stream pays t_e once a frame:
    this is the computation of one window that starts from nothing, not the latency.

    Raises
    ------
    InputError
        If a time is negative or no number, or `sequence_length` is not positive.
    """
    _not_negative(t_e=t_e, t_m=t_m)
    _positive(sequence_length=sequence_length)
    return t_e * sequence_length + t_m


def t_total(t_e: float, t_m: float, t_c: float, sequence_length: float = 1) -> float:
    """Return the seconds with compression, `t_vpr` + t_c K (equations 6.4 and 6.5).

    `t_c` is the time to JPEG-encode one frame. Raises as `t_vpr`.
    """
    _not_negative(t_c=t_c)
    return t_vpr(t_e, t_m, sequence_length) + t_c * sequence_length


def data_volume(mean_image_size: float, sequence_length: float = 1) -> float:
    """Return d, the data one answer needs: mean image size x K (equation 6.1), in its unit.

    Raises
    ------
    InputError
        If the size is negative or no number, or `sequence_length` is not positive.
    """
    _not_negative(mean_image_size=mean_image_size)
    _positive(sequence_length=sequence_length)
    return mean_image_size * sequence_length


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not (value > 0 and math.isfinite(value)):
            raise InputError(f"{name}: got {value}, expected a positive number")


def _not_negative(**values: float) -> None:
    for name, value in values.items():
        if not (value >= 0 and math.isfinite(value)):
            raise InputError(f"{name}: got {value}, expected a number of at least 0")
