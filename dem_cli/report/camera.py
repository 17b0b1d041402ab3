"""A camera without perspective, and what it paints: triangles and strokes sorted from far to near, in light from above its left shoulder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dem_cli.state import Floats

DEFAULT_VIEW = (-62.0, 24.0)  # azimuth and elevation [deg]
DARKEST = 0.55  # brightness of a face that no light falls on
SEAM = 0.8  # points; an edge in the colour of its face closes the hairline between neighbours


@dataclass(frozen=True)
class Camera:
    """Looks along -toward; unit vectors (3,) to the right, up and towards the viewer."""

    right: Floats
    up: Floats
    toward: Floats

    @classmethod
    def at(cls, azimuth: float, elevation: float) -> Camera:
        """azimuth [deg]: of the viewer, from +x towards +y; elevation [deg] over the horizontal."""
        a, e = np.radians(azimuth), np.radians(elevation)
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        toward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        return cls(right, np.cross(toward, right), toward)

    @property
    def light(self) -> Floats:
        """Unit vector to the light."""
        found = 0.55 * self.toward + 0.65 * self.up - 0.45 * self.right
        return np.asarray(found / np.linalg.norm(found))

    def screen(self, points: Floats) -> Floats:
        """Right and up of points (..., 3) [m]: (..., 2)."""
        return np.asarray(points @ np.stack([self.right, self.up], axis=1))

    def depth(self, points: Floats) -> Floats:
        """How near points (..., 3) are [m]: (...)."""
        return np.asarray(points @ self.toward)

    def shade(self, normals: Floats) -> Floats:
        """Brightness, DARKEST to 1, of faces with unit normals (..., 3)."""
        return np.asarray(DARKEST + (1.0 - DARKEST) * np.clip(normals @ self.light, 0.0, 1.0))


@dataclass(frozen=True)
class Paint:
    """Polygons of three corners, strokes among them (their third corner is the first): corners (p, 3, 2) [m] on the screen, depth (p,) [m],
    face and edge colours (p, 4), and the width of edges (p,) [points]."""

    corners: Floats
    depth: Floats
    face: Floats
    edge: Floats
    width: Floats

    @classmethod
    def together(cls, parts: list[Paint]) -> Paint:
        """All of them from far to near."""
        if not parts:
            return cls(np.empty((0, 3, 2)), np.empty(0), np.empty((0, 4)), np.empty((0, 4)), np.empty(0))
        whole = [
            np.concatenate([getattr(p, name) for p in parts]) for name in ("corners", "depth", "face", "edge", "width")
        ]
        order = np.argsort(whole[1], kind="stable")
        return cls(*(array[order] for array in whole))


def faces(camera: Camera, triangles: Floats, normals: Floats, colors: Floats, back: Floats | float = 0.0) -> Paint:
    """Triangles (t, 3, 3) [m] with outward normals (t, 3) and colours (t, 3), those that face away left out. back [m]: pushes them away."""
    front = normals @ camera.toward > 1e-9
    corners, light = triangles[front], camera.shade(normals[front])
    rgb = np.clip(colors[front] * light[:, None], 0.0, 1.0)
    color = np.concatenate([rgb, np.ones((len(rgb), 1))], axis=1)
    away = np.broadcast_to(np.asarray(back, dtype=float), len(triangles))[front]
    return Paint(
        camera.screen(corners), camera.depth(corners).mean(axis=1) - away, color, color, np.full(len(rgb), 0.35)
    )


def strokes(camera: Camera, segments: Floats, color: str, width: float, forward: Floats | float = 0.0) -> Paint:
    """Lines (s, 2, 3) [m]; forward [m]: brings them nearer, before the faces that meet in them."""
    from matplotlib.colors import to_rgba

    corners = camera.screen(segments)[:, [0, 1, 0]]
    n = len(segments)
    ink = np.tile(to_rgba(color), (n, 1))
    return Paint(corners, camera.depth(segments).mean(axis=1) + forward, np.zeros((n, 4)), ink, np.full(n, width))
