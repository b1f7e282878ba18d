"""The lines of `benchmarks.performance`: what is computed, its time, its error, and beside whom.

Numbers stand as `{result.figure}` or, in another style, `{result.figure .2f}`, see
`benchmarks.figures`; all of a line are of one result.
"""

from dataclasses import dataclass

_ASKED = "1e-4 was asked for, and is not tried in that run"
_NOT_COMPARED = "it was not compared with the thorough search"
_SAME = "both answers are of the same program"
_ALONE = "nothing else was timed in that run"


@dataclass(frozen=True)
class Line:
    """One line of the table.

    result: name of the file that all its numbers are of.
    what: is computed.
    time: or what is done in a second.
    error: against what its words say; empty if there is none, and then `no_error` says why.
    peer: program or method beside which it was timed, with its own error where that is known;
    empty if there is none, and then `no_peer` says why.
    peer_time: in the same unit.
    ratio: the peer's time over ours; below one the peer is faster.
    """

    result: str
    what: str
    time: str
    error: str = ""
    no_error: str = ""
    peer: str = ""
    no_peer: str = ""
    peer_time: str = ""
    ratio: str = ""


def _spectrum(asked: str, key: str) -> tuple[Line, Line]:
    """Value, and value and gradient, each beside the cheapest setting of a peer that keeps the
    error asked for.
    """
    error = f"{{frontier.error_{key}}}, against a finer run"
    return (
        Line(
            result="frontier",
            what=f"41 wavelengths, two layers, asked for {asked}",
            time=f"{{frontier.value_{key}}} ms",
            error=error,
            peer=f"CDISORT, no surface, error {{frontier.cdisort_error_{key}}}",
            peer_time=f"{{frontier.cdisort_ms_{key}}} ms",
            ratio=f"{{frontier.cdisort_asked_{key}}}",
        ),
        Line(
            result="frontier",
            what=f"and its gradient, asked for {asked}",
            time=f"{{frontier.slopes_{key}}} ms",
            error=error,
            peer=f"sasktran2, no surface, one mode, error {{frontier.sasktran2_error_{key}}}",
            peer_time=f"{{frontier.sasktran2_ms_{key}}} ms",
            ratio=f"{{frontier.sasktran2_asked_{key}}}",
        ),
    )


def _first(command: str, key: str) -> Line:
    """First answer of a command beside its second."""
    return Line(
        result="cold_start",
        what=f"{command}, first time",
        time=f"{{cold_start.{key}_empty}} s",
        no_error=_SAME,
        peer="again, programs kept",
        peer_time=f"{{cold_start.{key}_again}} s",
        ratio=f"{{cold_start.{key}_over}}",
    )


def _identified(what: str, key: str) -> Line:
    """Spectra a second, in turn with an earlier commit."""
    return Line(
        result="identification_speed",
        what=f"identification, {what}",
        time=f"{{identification_speed.{key}_rate}} spectra/s",
        error=(
            f"first set as by the thorough search {{identification_speed.{key}_same}} %, "
            f"a probability .02 off {{identification_speed.{key}_off}} %"
        ),
        peer="an earlier commit, in turn",
        peer_time=f"{{identification_speed.{key}_before_rate}} spectra/s",
        ratio=f"{{identification_speed.{key}_times}}",
    )


def _sampled(what: str, key: str) -> Line:
    """Effective draws of a second beside emcee's."""
    return Line(
        result="samplers",
        what=f"effective draws by HMC, {what}",
        time=f"{{samplers.{key}hmc_rate}} draws/s",
        error=f"R-hat {{samplers.{key}hmc_apart}}",
        peer=f"emcee, R-hat {{samplers.{key}emcee_apart}}",
        peer_time=f"{{samplers.{key}emcee_rate}} draws/s",
        ratio=f"{{samplers.{key}times}}",
    )


def _paper_a(peer: str, key: str) -> Line:
    """Paper A's fixed step of .01 beside one of the methods that it replaces."""
    return Line(
        result="paper_tables",
        what="paper A's fixed step of .01, its table counted",
        time="{paper_tables.fixed_ms} ms",
        error="{paper_tables.fixed_error} at most, against the default solver",
        peer=f"{peer}, error {{paper_tables.{key}_error}}",
        peer_time=f"{{paper_tables.{key}_ms}} ms",
        ratio=f"{{paper_tables.{key}_times}}",
    )


LINES = (
    *_spectrum("1e-4", "1e4"),
    *_spectrum("1e-8", "1e8"),
    Line(
        result="frontier",
        what="and its gradient, asked for 1e-6",
        time="{frontier.slopes_1e6} ms",
        error="{frontier.error_1e6}, against a finer run",
        peer="the value alone",
        peer_time="{frontier.value_1e6} ms",
        ratio="{frontier.alone}",
    ),
    Line(
        result="scaling",
        what="41 wavelengths, 40 layers",
        time="{scaling.layers_40} ms",
        no_error=_ASKED,
        peer="CDISORT, no surface",
        peer_time="{scaling.layers_40_cdisort} ms",
        ratio="{scaling.layers_40_times}",
    ),
    Line(
        result="scaling",
        what="a million stacks of two layers, asked for 1e-4",
        time="{scaling.million_seconds .2f} s",
        no_error=_ASKED,
        no_peer=_ALONE,
    ),
    Line(
        result="scaling",
        what="and slopes by albedo and thickness",
        time="{scaling.million_slopes .2f} s",
        no_error=_ASKED,
        peer="the values alone",
        peer_time="{scaling.million_seconds .2f} s",
        ratio="{scaling.million_alone}",
    ),
    Line(
        result="scaling",
        what="the values in single precision",
        time="{scaling.million_single} s",
        no_error=_ASKED,
        peer="double precision",
        peer_time="{scaling.million_seconds .2f} s",
        ratio="{scaling.million_single_times}",
    ),
    Line(
        result="savings",
        what="a glazed picture, 512 x 512 pixels, 31 bands",
        time="{savings.picture} s",
        error="ΔE00 {savings.delta_e_most} at most, against pixel by pixel",
        peer="pixel by pixel, from a sample",
        peer_time="{savings.pixel_by_pixel} s",
        ratio="{savings.times}",
    ),
    Line(
        result="scene_speed",
        what="a scene, 640 x 480 pixels, 31 bands",
        time="{scene_speed.again} s",
        error="{scene_speed.apart} % of the mean, against all rays",
        peer="all rays of every pixel",
        peer_time="{scene_speed.full} s",
        ratio="{scene_speed.times}",
    ),
    _identified("31 bands over two cards", "two"),
    _identified("61 bands over one card", "fine"),
    Line(
        result="identification_speed",
        what="identification, 2151 bands over one card",
        time="{identification_speed.finest_rate} spectra/s",
        no_error=_NOT_COMPARED,
        no_peer=_ALONE,
    ),
    Line(
        result="painting",
        what="a map of ten million pixels, 200 bands",
        time="{painting.large_seconds .0f} s",
        error="first set as by the full search {painting.same_set} %",
        peer="full search, from a sample",
        peer_time="{painting.full_hours} h",
        ratio="{painting.full_times}",
    ),
    Line(
        result="painting",
        what="a map of a million pixels, 200 bands",
        time="{painting.million_rate} pixels/s",
        error="right set {painting.map_right} %",
        peer="spectral angle, right set {painting.angle_right} %",
        peer_time="{painting.angle_rate} pixels/s",
        ratio="{painting.angle_times}",
    ),
    _first("`render`", "render"),
    _first("`recover`, twelve masstones", "recover"),
    _first("`identify`, twelve films", "identify"),
    _first("`recipe --srgb`", "recipe"),
    _sampled("a coat of unknown paint", ""),
    _sampled("a film band by band", "bands_"),
    Line(
        result="page_solver",
        what="the page's solver, eight coats, 31 bands",
        time="{page_solver.eight_coats} ms",
        error="ΔE00 {page_solver.delta_e} at most, against the default solver",
        peer="small matrices, ΔE00 {page_solver.matrices_largest} at most",
        peer_time="{page_solver.matrices_ms} ms",
        ratio="{page_solver.matrices_times}",
    ),
    _paper_a("entries by quadrature", "conventional"),
    _paper_a("a step for each wavelength", "own"),
    Line(
        result="manyflux_speed",
        what="many fluxes, no surface, 31 bands, 722 pairs of angles",
        time="{manyflux_speed.seconds} s",
        error="{manyflux_speed.error}, against a run at 1e-5",
        peer="PythonicDISORT, error {manyflux_speed.peer_error}",
        peer_time="{manyflux_speed.peer_seconds} s",
        ratio="{manyflux_speed.times}",
    ),
)
