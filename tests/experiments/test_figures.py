"""Figures: equal bytes for equal figures, and contenders that differ without their colours."""

from nerfnav.experiments.figures import COLORS, Figure, bars, draw_distribution, file_of, panels


def contenders() -> Figure:
    figure, (left, right) = panels(("bars", "lines"))
    bars(left, dict.fromkeys("abcde", 1.0), "m")
    for color in COLORS:
        draw_distribution(right, [0.0, 1.0], color, color)
    right.legend()
    return figure


def test_a_figure_is_the_same_file_each_time() -> None:
    for kind, begin in (("png", b"\x89PNG"), ("svg", b"<?xml")):
        first, second = (file_of(contenders(), kind) for _ in range(2))  # type: ignore[arg-type]
        assert first == second and first.startswith(begin)


def test_each_contender_has_a_style_of_its_own_without_its_colour() -> None:
    figure = contenders()
    file_of(figure, "svg")
    left, right = figure.axes
    legend = right.get_legend()
    assert legend is not None
    assert len({bar.get_hatch() for bar in left.patches}) == len(COLORS)
    for lines in (right.lines, legend.get_lines()):
        assert len({line._dash_pattern[1] and tuple(line._dash_pattern[1]) for line in lines}) == len(COLORS)


def test_hairlines_and_lines_with_a_style_keep_it() -> None:
    figure, (axes,) = panels(("one",))
    (thin,) = axes.plot([0, 1], color=COLORS[1], linewidth=0.5)
    (dotted,) = axes.plot([0, 1], ":", color=COLORS[1])
    file_of(figure, "png")
    assert (thin.get_linestyle(), dotted.get_linestyle()) == ("-", ":")
