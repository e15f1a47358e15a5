// Additions to viser's page that its Python API lacks: lines drawn over walls, and help by "?".
"use strict";
(() => {
  const EVERY_MS = 250;

  // A line whose name ends in /through is drawn over everything, faintly: viser has no such property of lines.
  const THROUGH = "/through", OPACITY = 0.4;
  setInterval(() => {
    const nodes = window.__viserMutable?.nodeRefFromName ?? {};
    for (const name in nodes) {
      if (!name.endsWith(THROUGH)) continue;
      nodes[name]?.traverse(part => {
        const material = part.material;
        if (!material || material.depthTest === false) return;
        Object.assign(material, {depthTest: false, depthWrite: false, transparent: true, opacity: OPACITY});
        material.needsUpdate = true;
        part.renderOrder = 10;
      });
    }
  }, EVERY_MS);

  // viser shows the progress of an upload in every other tab, without its name.
  setInterval(() => {
    for (const title of document.querySelectorAll(".mantine-Notification-title")) {
      if (title.textContent.startsWith("Uploading undefined")) {
        title.closest(".mantine-Notification-root").style.display = "none";
      }
    }
  }, EVERY_MS);

  // Help opens by itself on the first visit of this browser, and by "?".
  const SEEN = "nerfnav-help-seen", help = document.getElementById("nerfnav-help");
  const open = () => { if (!help.open) help.showModal(); };
  document.getElementById("nerfnav-ask").addEventListener("click", open);
  help.addEventListener("click", event => { if (event.target === help) help.close(); });
  help.addEventListener("close", () => localStorage.setItem(SEEN, "1"));
  if (!localStorage.getItem(SEEN)) open();
  window.addEventListener("keydown", event => {
    if (event.key === "?" && !event.target.closest?.("input, textarea")) open();
  });
})();
