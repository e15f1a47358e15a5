// Where WebGL is drawn in software, a frame costs a third less without antialiasing, and each pixel counts: fewer of
// them are drawn while a pointer drags. Pages that ask for a pixel ratio of 1 or more get what they ask for.
"use strict";
(() => {
  const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;
  const HELD_RATIO = 0.5, REST_MS = 400;
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
  if (asked !== null) return;

  // react-three-fiber's store, which knows the pixel ratio
  const store = () => window.__viserMutable?.scene?.__r3f?.root?.getState();
  let rested = null, timer = 0;
  const draw = ratio => {
    store()?.setDpr(ratio);
    const {gl, scene, camera} = store() ?? {};
    gl?.render(scene, camera);  // at once: another size has emptied the canvas
  };
  window.addEventListener("pointerdown", event => {
    const now = store()?.viewport.dpr;
    if (event.target !== window.__viserMutable?.canvas || now === undefined) return;
    clearTimeout(timer);
    rested ??= now;
    draw(Math.min(HELD_RATIO, rested));
  }, true);
  const rest = () => {
    if (rested === null) return;
    clearTimeout(timer);
    timer = setTimeout(() => { draw(rested); rested = null; }, REST_MS);
  };
  for (const end of ["pointerup", "pointercancel"]) window.addEventListener(end, rest, true);
})();
