"""A session's scene as one HTML file that needs no server and no net."""

import secrets

from server.scenes.display_options import look_at
from server.scenes.layers import LAYERS, draw
from server.scenes.legend import legend_html
from server.scenes.live import start_at, start_viser, stop_viser
from server.scenes.page import offline_page
from server.scenes.scene_input import SceneInput
from server.scenes.scene_model import scene_facts
from server.scenes.views import first_view, view


def scene_html(scene: SceneInput) -> str:
    """Return the scene as a self-contained HTML page."""
    facts = scene_facts(scene)
    look = look_at(facts)
    server = start_viser(secrets.token_urlsafe())
    try:
        start_at(server, view(first_view(facts), facts))
        for root in LAYERS:
            server.scene.add_frame(f"/{root}", show_axes=False)
        for node in draw(facts, look).values():
            node.add_to(server.scene)
        page = server.get_scene_serializer().as_html()
    finally:
        stop_viser(server)
    return offline_page(page, scene.session.name or "Scene", legend_html(facts, look))
