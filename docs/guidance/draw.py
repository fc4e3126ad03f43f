"""A chart as SVG: dots and lines over two axes, legible on light and dark grounds."""

from html import escape

WIDTH, HEIGHT = 720, 300
LEFT, RIGHT, TOP, BOTTOM = 64, 210, 34, 50
STYLE = """
    svg { color-scheme: light dark; font-family: system-ui, -apple-system, "Segoe UI", Roboto, Helvetica, Arial, sans-serif; }
    text { fill: #1c2128; font-size: 13px; }
    .head { font-size: 15px; font-weight: 600; }
    .axis { stroke: #5c6672; stroke-width: 1; fill: none; }
    .grid { stroke: #5c6672; stroke-width: 0.6; stroke-dasharray: 2 4; opacity: 0.6; }
    .true { stroke: #1c2128; stroke-width: 1.4; stroke-dasharray: 7 4; fill: none; }
    .c0 { --c: #d1342f; } .c1 { --c: #2f7fc1; } .c2 { --c: #3b8f4d; } .c3 { --c: #8a5bc4; } .c4 { --c: #b8741a; }
    .line { fill: none; stroke: var(--c); stroke-width: 1.8; }
    .dot { fill: var(--c); fill-opacity: 0.75; }
    @media (prefers-color-scheme: dark) {
      text { fill: #e4e8ec; }
      .axis, .grid { stroke: #9aa5b1; }
      .true { stroke: #e4e8ec; }
      .c0 { --c: #ff6f66; } .c1 { --c: #5ba6e8; } .c2 { --c: #67c07b; } .c3 { --c: #b592e6; } .c4 { --c: #e0a04a; }
    }
"""


def chart(title, description, x, y, series, true=None):
    """An SVG.

    `x` and `y` are axes: (label, low, high, ticks), ticks pairs of value and text. `series` are (name, points, lines):
    points (x, y) as dots, and those of `lines` joined. `true` is a value of y with its name, drawn across.
    """
    plane = Plane(x, y)
    parts = [f'<text class="head" x="{LEFT}" y="20">{escape(title)}</text>', *plane.axes()]
    if true:
        height = plane.y(true[0])
        parts.append(f'<path class="true" d="M{LEFT} {height}H{WIDTH - RIGHT}"/>')
        parts.append(f'<text x="{WIDTH - RIGHT + 8}" y="{height + 4}">{escape(true[1])}</text>')
    for k, (name, points, line) in enumerate(series):
        dots = [f'<circle class="dot" cx="{plane.x(a)}" cy="{plane.y(b)}" r="3"/>' for a, b in points]
        if line:
            path = "L".join(f"{plane.x(a)} {plane.y(b)}" for a, b in line)
            dots.append(f'<path class="line" d="M{path}"/>')
        top = TOP + 14 + 20 * k
        dots.append(f'<circle class="dot" cx="{WIDTH - RIGHT + 14}" cy="{top - 4}" r="4"/>')
        dots.append(f'<text x="{WIDTH - RIGHT + 24}" y="{top}">{escape(name)}</text>')
        parts.append(f'<g class="c{k}">' + "".join(dots) + "</g>")
    body = "\n  ".join(parts)
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
            f'aria-labelledby="title description">\n  <title id="title">{escape(title)}</title>\n'
            f'  <desc id="description">{escape(description)}</desc>\n  <style>{STYLE}  </style>\n  {body}\n</svg>\n')


class Plane:
    """Where values lie on the page."""

    def __init__(self, x, y):
        self.across, self.up = x, y

    def x(self, value):
        _, low, high, _ = self.across
        return round(LEFT + (WIDTH - LEFT - RIGHT) * (value - low) / (high - low), 1)

    def y(self, value):
        """What lies beyond the axis stands on its edge."""
        _, low, high, _ = self.up
        return round(HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (min(max(value, low), high) - low) / (high - low), 1)

    def axes(self):
        bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT
        parts = [f'<path class="axis" d="M{LEFT} {TOP}V{bottom}H{right}"/>']
        for value, text in self.across[3]:
            parts.append(f'<text x="{self.x(value)}" y="{bottom + 18}" text-anchor="middle">{escape(text)}</text>')
        for value, text in self.up[3]:
            height = self.y(value)
            parts.append(f'<path class="grid" d="M{LEFT} {height}H{right}"/>')
            parts.append(f'<text x="{LEFT - 8}" y="{height + 4}" text-anchor="end">{escape(text)}</text>')
        middle = (TOP + bottom) / 2
        parts.append(f'<text x="{(LEFT + right) / 2}" y="{HEIGHT - 10}" text-anchor="middle">{escape(self.across[0])}</text>')
        parts.append(f'<text transform="translate(16 {middle}) rotate(-90)" text-anchor="middle">{escape(self.up[0])}</text>')
        return parts
