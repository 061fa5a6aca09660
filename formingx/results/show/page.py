"""Elements of an HTML page, as HTML text."""

import base64
import html
import io
import math
from importlib import resources
from typing import Any


def page(title: str, body: list[str], tail: str = "") -> str:
    """Return a whole HTML page with its style sheet and scripts `tail`; `title` is that of the window."""
    style = resources.files(__package__).joinpath("report.css").read_text()
    return (f"<!doctype html>\n<html lang=en><head><meta charset=utf-8><title>{html.escape(title)}</title>"
            f"<meta name=viewport content='width=device-width, initial-scale=1'><style>{style}</style></head>\n<body>"
            + "\n".join(body) + tail + "</body></html>\n")


def table(head: list[str], rows: list[list[str]]) -> str:
    """Return a table of texts as HTML, numbers aligned right; without names of columns it has no head."""
    numbers = [any(head) and all(_is_number(row[k]) for row in rows) for k in range(len(head))]

    def line(tag, row):
        return "".join(f"<{tag}{' class=number' if number else ''}>{html.escape(text)}</{tag}>"
                       for text, number in zip(row, numbers))
    lines = [line("th", head)] if any(head) else []
    lines += [line("td", row) for row in rows]
    return "<div class=scroll><table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table></div>"


def _is_number(text: str) -> bool:
    """Return True if the text of a cell is a number or empty."""
    try:
        float(text or 0)
    except ValueError:
        return False
    return True


def details(title: str, content: str) -> str:
    """Return a collapsed section as HTML: a click on its title shows its content."""
    return f"<details><summary>{html.escape(title)}</summary>{content}</details>"


def figure(figure: Any, caption: str, kind: str = "wide") -> str:
    """Return a matplotlib figure with a caption as HTML, as an embedded PNG picture, "wide" or "small"."""
    stream = io.BytesIO()
    figure.savefig(stream, dpi=140)
    return picture(stream.getvalue(), caption, kind)


def picture(png: bytes, caption: str, kind: str) -> str:
    """Return a PNG picture with a caption as HTML, embedded, "wide" or "small"."""
    text = html.escape(caption, quote=True)
    return (f"<figure class={kind}><img alt='{text}' src='data:image/png;base64,{base64.b64encode(png).decode()}'>"
            f"<figcaption>{text}</figcaption></figure>")


def logarithmic(lines: list[list[float]], x: str, y: str, caption: str) -> str:
    """Return a small figure of lines with a logarithmic vertical axis and a caption, as HTML with an SVG drawing.

    Values of a line are positive, drawn over 1, 2, 3, ...; empty lines are left out.
    """
    values = [value for line in lines for value in line]
    low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
    high, longest = max(high, low + 1), max(max(map(len, lines)), 2)
    left, top, width, height = 60, 10, 400, 260

    def across(number):
        return left + width * (number - 0.7) / (longest - 0.4)

    def down(exponent):
        return top + height * (high - exponent) / (high - low)
    drawn = []
    for number in range(1, longest + 1, 1 + longest // 12):
        drawn.append(f"<path class=line d='M{across(number):.1f} {top}v{height}' />"
                     f"<text x={across(number):.1f} y={top + height + 18}>{number}</text>")
    for exponent in range(low, high + 1, 1 + (high - low) // 8):
        drawn.append(f"<path class=line d='M{left} {down(exponent):.1f}h{width}' />"
                     f"<text class=left x={left - 6} y={down(exponent) + 5:.1f}>1e{exponent}</text>")
    for line in filter(None, lines):
        points = [f"M{across(k):.1f} {down(math.log10(value)):.1f}" for k, value in enumerate(line, 1)]
        drawn.append(f"<path d='{'L'.join(points).replace('LM', 'L')}' />")
        drawn += [f"<path class=dot d='{point}h0' />" for point in points]
    drawn += [f"<text x={left + width // 2} y=312>{html.escape(x)}</text>",
              f"<text x={-top - height // 2} y=14 transform='rotate(-90)'>{html.escape(y)}</text>"]
    words = html.escape(caption)
    return (f"<figure class=small><svg viewBox='0 0 480 320' role=img><title>{words}</title>{''.join(drawn)}</svg>"
            f"<figcaption>{words}</figcaption></figure>")


def lines(text: str) -> str:
    """Return a text as HTML with its line breaks."""
    return html.escape(text).replace("\n", "<br>")


def number(value: float, scale: float = 0.0) -> str:
    """Return a number with six significant digits; below 1e-9 times `scale` it is 0."""
    return f"{0.0 if abs(value) < 1e-9 * scale else value:.6g}"
