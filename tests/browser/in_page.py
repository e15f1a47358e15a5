"""What tests ask of a page: expressions that are evaluated there."""

from typing import Any

import numpy as np
from playwright.sync_api import Page

# where a world point is on the screen [pixels], by the page's own camera
TO_SCREEN = """
([x, y, z]) => {
  const mutable = window.__viserMutable, camera = mutable.camera;
  const root = mutable.nodeRefFromName[''];
  const point = camera.position.clone().set(x, y, z);
  root.updateWorldMatrix(true, false);
  root.localToWorld(point);
  point.project(camera);
  const box = mutable.canvas.getBoundingClientRect();
  return [box.left + (point.x + 1) / 2 * box.width, box.top + (1 - point.y) / 2 * box.height];
}
"""
POSITION = "name => Array.from(window.__viserMutable.nodePoseData[name]?.position ?? [NaN, NaN, NaN])"
PROPERTY = """
([name, property]) => {
  const node = window.__viserSceneTree.getState()[name];
  if (!node || !node.message || !node.message.props) return null;
  const value = node.message.props[property];
  return ArrayBuffer.isView(value) ? Array.from(value) : value;
}
"""
VISIBLE = """
name => {
  const node = window.__viserSceneTree.getState()[name];
  return !!node && (node.visibility ?? true);
}
"""

# some frames are drawn, so that nodes are where they were told to be; in a tab that draws none, a second passes
DRAWN = """
() => new Promise(done => {
  const draw = left => left ? requestAnimationFrame(() => draw(left - 1)) : done();
  draw(4);
  setTimeout(done, 1000);
})
"""
IS_SCENE = "([x, y]) => document.elementFromPoint(x, y)?.tagName === 'CANVAS'"
"""Whether nothing lies over the scene at a place on the screen [pixels]: a notification passes."""


def to_screen(page: Page, point: Any) -> tuple[float, float]:
    """Where a world point (3,) [m] is on the screen [pixels]."""
    x, y = page.evaluate(TO_SCREEN, np.asarray(point, dtype=np.float64).tolist())
    return x, y
