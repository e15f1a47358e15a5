// Where WebGL is drawn in software, a frame takes the processor from the flight that it shows: a third less of it
// without antialiasing. What moves by itself is drawn 20 times a second, and nothing in the panel glides, for each step
// of that is a frame. A hand has all frames, and fewer pixels in them while it drags. Pages that ask for a pixel ratio
// of 1 or more get what they ask for.
"use strict";
(() => {
  const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;
  const HELD_RATIO = 0.5, REST_MS = 400;
  const FRAME_MS = 45;  // the next frame of a screen that shows 60 a second is the third
  const asked = new URLSearchParams(location.search).get("fixedDpr");
  const getContext = HTMLCanvasElement.prototype.getContext;

  const isSoftware = () => {
    const gl = getContext.call(document.createElement("canvas"), "webgl2");
    const info = gl?.getExtension("WEBGL_debug_renderer_info");
    const name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
    gl?.getExtension("WEBGL_lose_context")?.loseContext();
    return SOFTWARE.test(name);
  };

  if (Number(asked) >= 1 || !isSoftware()) return;

  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    return getContext.call(this, kind, /^webgl/.test(kind) ? {...options, antialias: false} : options);
  };

  const still = document.createElement("style");
  // short, but there: parts of the panel wait for the end of theirs
  still.textContent = `*, *::before, *::after {
    transition-duration: 1ms !important; animation-duration: 1ms !important; animation-iteration-count: 1 !important;
  }`;
  document.head.append(still);

  let handUntil = 0, framedAt = 0, count = 0;
  window.addEventListener("pointerdown", () => { handUntil = Infinity; }, true);
  window.addEventListener("wheel", () => { handUntil = Math.max(handUntil, performance.now() + REST_MS); }, true);
  for (const end of ["pointerup", "pointercancel"]) {
    window.addEventListener(end, () => { handUntil = performance.now() + REST_MS; }, true);
  }
  const request = window.requestAnimationFrame.bind(window), cancel = window.cancelAnimationFrame.bind(window);
  const waiting = new Map();  // how each request is taken back
  window.requestAnimationFrame = callback => {
    const id = ++count, now = performance.now(), left = now < handUntil ? 0 : framedAt + FRAME_MS - now;
    const ask = () => {
      const requested = request(time => { waiting.delete(id); framedAt = performance.now(); callback(time); });
      waiting.set(id, () => cancel(requested));
    };
    if (left <= 0) ask();
    else {
      const timer = setTimeout(ask, left);
      waiting.set(id, () => clearTimeout(timer));
    }
    return id;
  };
  window.cancelAnimationFrame = id => {
    waiting.get(id)?.();
    waiting.delete(id);
  };
  if (asked !== null) return;

  // react-three-fiber's store, which knows the pixel ratio
  const store = () => window.__viserMutable?.scene?.__r3f?.root;
  let rested = null, held = null, watched = null, timer = 0;
  const draw = ratio => {
    store()?.getState().setDpr(ratio);
    const {gl, scene, camera} = store()?.getState() ?? {};
    gl?.render(scene, camera);  // at once: another size has emptied the canvas
  };
  // viser sets the ratio too, by how many frames come: while a pointer holds, that is for when it rests
  const keep = ({viewport: {dpr}}) => {
    if (rested === null || dpr === held) return;
    rested = dpr;
    draw(held);
  };
  window.addEventListener("pointerdown", event => {
    const now = store()?.getState().viewport.dpr;
    if (event.target !== window.__viserMutable?.canvas || now === undefined) return;
    clearTimeout(timer);
    if (watched !== store()) (watched = store()).subscribe(keep);
    held = Math.min(HELD_RATIO, rested ?? now);
    rested ??= now;
    draw(held);
  }, true);
  const rest = () => {
    if (rested === null) return;
    clearTimeout(timer);
    timer = setTimeout(() => { const ratio = rested; rested = null; draw(ratio); }, REST_MS);
  };
  for (const end of ["pointerup", "pointercancel"]) window.addEventListener(end, rest, true);
})();
