"""From raw frames to points: board, camera, stripe, laser plane, triangulation."""
