"""The application: what it is made of, and what happens at its start and end."""

import threading
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from functools import partial

from fastapi import FastAPI
from starlette.concurrency import run_in_threadpool
from starlette.middleware.gzip import GZipMiddleware

from calib_core import __version__
from server.auth.logins import Logins
from server.auth.middleware import AuthMiddleware
from server.auth.refusals import Refusals
from server.auth.roles import role_of
from server.captures.cluster_measuring import ClusterMeasuring
from server.captures.intake import Intake
from server.captures.measuring_queue import MeasuringQueue
from server.guides import Guides, stored_texts
from server.health import HealthWatch
from server.housekeeping import Housekeeping
from server.http import errors, openapi
from server.http.access_log import AccessLog
from server.http.body_draining import BodyDraining
from server.http.disconnects import Disconnects
from server.http.events import Hub
from server.http.head_requests import HeadRequests
from server.http.language import AnswerLanguage
from server.http.page_files import PageFiles
from server.http.security_headers import SecurityHeaders
from server.http.stopping import Stopping
from server.http.timeouts import Timeouts
from server.http.uploads import UploadMemory
from server.jobs.jobs import Jobs
from server.jobs.kernels import KernelCompiler
from server.jobs.measuring_processes import Measuring
from server.jobs.page_process import PageProcess
from server.jobs.processes import replace_all
from server.live.armed_table import ArmedTables
from server.live.manager import LiveCells, follow_robot
from server.live.robot_port import RobotPorts
from server.metrics import Metrics
from server.routes import all_routers
from server.scenes.advice import SceneAdviser
from server.scenes.cloud_controls import cloud_router
from server.scenes.controls import controls_router
from server.scenes.manager import SceneManager
from server.scenes.pose_preview_routes import trials_router
from server.scenes.review_scenes import PastScenes
from server.scenes.router import scenes_router
from server.scenes.stored import follow_scene
from server.settings import Settings
from server.sources.watched_folder import session_watcher
from server.store.database import Store
from server.store.group_commit import GroupCommit
from server.store.store_lock import DatabaseLock
from server.store.updates import updated_since
from server.webhooks.sender import WebhookSender

_DESCRIPTION = """Calibrates a laser scanning cell: sessions, captures, solves, results.

Lengths are millimetres. Errors are problem details (RFC 9457) whose `detail` says what to do. Every POST takes an
`Idempotency-Key`. Lists are paged by the cursor in `next`. Changes take in `If-Match` the `ETag` of what
they change."""

_UPLOADS_IN_MEMORY = 3
"""How many of the largest uploads may be in memory at once."""


def create_app(settings: Settings | None = None) -> FastAPI:
    """Return the application; its store is opened when it starts, not before."""
    settings = settings or Settings()
    hub = Hub()

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncGenerator[None]:
        lock: DatabaseLock | None = getattr(app.state, "database_lock", None)
        store = Store(settings, hub.publish, None if lock is None else lock.require)
        sender = app.state.webhooks = WebhookSender(settings, store)
        hub.wake_at_events(sender.wake)
        app.state.metrics.watch_store(store, settings.data)
        measuring = Measuring(
            settings.measuring_processes,
            settings.measuring_timeout_s,
            settings.warm_up,
            settings.blob_place.observations,
        )
        measuring_queue = MeasuringQueue(store, measuring)
        jobs = Jobs(settings, store, hub, measuring_queue.wake)
        if settings.dask is not None:
            measuring_queue.measure_far(ClusterMeasuring(jobs.submit_measuring, measuring, settings))
        kernels = app.state.kernels = KernelCompiler()
        page_process = app.state.page_process = PageProcess(settings.warm_up)
        guides = app.state.guides = Guides(stored_texts(store), page_process)
        past_scenes = PastScenes(store, SceneAdviser(page_process))
        health_watch = app.state.health = HealthWatch(
            {
                "database": store.trouble,
                "files": store.blobs.trouble,
                "jobs": jobs.trouble,
                **({} if lock is None else {"lock": lambda: lock.trouble}),
            }
        )
        scenes = SceneManager(past_scenes.load, partial(follow_scene, hub))
        app.state.past_scenes = past_scenes
        app.state.store, app.state.jobs, app.state.scenes = store, jobs, scenes
        housekeeping = Housekeeping(store, settings.data)
        group_commit = GroupCommit(store)
        app.state.measuring, app.state.measuring_queue = measuring, measuring_queue
        intake = app.state.intake = Intake(store, measuring, group_commit)
        app.state.logins = Logins(settings.data, store)
        watcher = app.state.watcher = session_watcher(settings, store, intake)
        live = app.state.live = LiveCells(settings.data, store, intake, partial(follow_robot, scenes))
        tables = app.state.armed_tables = ArmedTables(live)
        ports = app.state.robot_ports = RobotPorts(store, live, app.state.logins, app.state.refusals)
        try:
            await run_in_threadpool(_start, store, jobs)
            group_commit.start()
            measuring_queue.start()
            watcher.start()
            await run_in_threadpool(live.start)
            housekeeping.start()
            sender.start()
            health_watch.start()
            if settings.warm_up:
                threading.Thread(target=_get_ready, args=(measuring, kernels), daemon=True).start()
            yield
        finally:
            hub.close()
            await run_in_threadpool(scenes.stop)
            guides.stop()
            kernels.stop()
            await run_in_threadpool(page_process.stop)
            await run_in_threadpool(jobs.stop)
            await run_in_threadpool(watcher.stop)
            await ports.close_all()
            await run_in_threadpool(tables.disarm_all)
            await run_in_threadpool(live.stop)
            await run_in_threadpool(measuring_queue.stop)
            await run_in_threadpool(housekeeping.stop)
            await run_in_threadpool(sender.stop)
            await run_in_threadpool(health_watch.stop)
            await run_in_threadpool(group_commit.stop)
            await run_in_threadpool(measuring.stop)
            store.close()

    app = FastAPI(
        title="scancell",
        version=__version__,
        description=_DESCRIPTION,
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        separate_input_output_schemas=False,
        openapi_tags=[{"name": tag} for tag in openapi.TAGS],
    )
    app.state.settings, app.state.hub, app.state.refusals = settings, hub, Refusals()
    app.state.metrics = Metrics()
    app.state.upload_memory = UploadMemory(_UPLOADS_IN_MEMORY * settings.max_upload_bytes)
    errors.install(app)
    openapi.install(app, role_of)
    for router in (*all_routers(), scenes_router, controls_router, trials_router, cloud_router):
        app.router.routes.extend(router.routes)
    app.state.page_files = PageFiles(settings.web, lambda: updated_since(settings.data))
    app.mount("/web", GZipMiddleware(app.state.page_files, minimum_size=500))
    app.add_middleware(HeadRequests)
    app.add_middleware(Timeouts, settings=settings)
    app.add_middleware(AuthMiddleware, settings=settings)
    app.add_middleware(SecurityHeaders, settings=settings)
    app.add_middleware(AnswerLanguage)
    app.add_middleware(BodyDraining)
    app.add_middleware(Stopping)
    app.add_middleware(Disconnects)
    app.add_middleware(AccessLog, metrics=app.state.metrics)
    return app


def _get_ready(measuring: Measuring, kernels: KernelCompiler) -> None:
    """Have a process that measures first; then what nobody waits for."""
    measuring.warm_up()
    kernels.start()
    if kernels.wait():
        replace_all()
        measuring.warm_up()


def _start(store: Store, jobs: Jobs) -> None:
    store.migrate()
    store.blobs.clean()
    jobs.start()
