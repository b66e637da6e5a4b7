"""What of a figure cannot be read: texts that leave it, and texts on one another."""

from itertools import combinations

from matplotlib.text import Text

SLACK = 1.5  # [px] that boxes may touch: they are larger than the letters


def flaws(figure):
    """A line for each text beyond the edge, and each two texts that overlap."""
    drawn = texts(figure)
    width, height = figure.canvas.get_width_height()
    beyond = [
        f"beyond the edge: {said!r}"
        for said, box in drawn
        if min(box.x0, box.y0, width - box.x1, height - box.y1) < -SLACK
    ]
    crossed = [
        f"on one another: {one!r} and {other!r}"
        for (one, first), (other, second) in combinations(drawn, 2)
        if overlap(first, second)
    ]
    return beyond + crossed


def texts(figure):
    """What is written, and the box around it, of each text that is drawn."""
    found = []
    draw = Text.draw

    def noted(text, renderer, *args, **kwargs):
        draw(text, renderer, *args, **kwargs)
        if text.get_visible() and text.get_text().strip():
            found.append((text.get_text(), text.get_window_extent(renderer)))

    figure.draw_without_rendering()  # the layout, once
    Text.draw = noted
    try:
        figure.draw_without_rendering()
    finally:
        Text.draw = draw
    return found


def overlap(one, other):
    """Whether two boxes lie on one another."""
    wide = min(one.x1, other.x1) - max(one.x0, other.x0)
    high = min(one.y1, other.y1) - max(one.y0, other.y0)
    return min(wide, high) > SLACK
