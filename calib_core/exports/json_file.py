"""JSON: tool and table in every pose convention, with their uncertainty."""

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Export, Settings
from calib_core.messages import message


def _write(answer: Answer, settings: Settings) -> str:
    from calib_core.exports.export import frames_json  # which imports the registry of this entry

    return frames_json(answer, settings)


_TITLE = message("JSON: tool and table in every pose convention")
EXPORT = Export("json", _TITLE, "application/json", ".json", _write, proof=None, open_too=True)
