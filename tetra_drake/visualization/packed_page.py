"""An HTML page, compressed, in a small one that unpacks it where it is opened."""

from __future__ import annotations

import base64
import gzip
import html

_PAGE = """\
<!DOCTYPE html>
<html>
<head>
<meta charset="utf-8">
<title>{title}</title>
</head>
<body>
<p id="state">Unpacking. This page needs JavaScript.</p>
<script>
  // What `base64 --decode | gunzip` makes of this text is the whole page.
  const packed = "{packed}";
  async function unpack() {{
    const bytes = Uint8Array.from(atob(packed), (character) => character.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const page = await new Response(stream).text();
    document.open();
    document.write(page);
    document.close();
  }}
  unpack().catch((error) => {{
    document.getElementById("state").textContent =
      `This page needs a browser of 2023 or later: ${{error.message}}`;
  }});
</script>
</body>
</html>
"""


def pack_page(page: str, *, title: str) -> str:
    """The page that turns into `page`; `title` is plain text. The same for the same arguments."""
    packed = base64.b64encode(gzip.compress(page.encode("utf-8"), mtime=0)).decode("ascii")
    return _PAGE.format(title=html.escape(title), packed=packed)
