// Additions to viser's page that its Python API lacks: lines drawn over walls, tooltips, keys, and help by "?".
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

  // A mark of a slider whose label is no number is an event: its label is shown as a tooltip alone.
  setInterval(() => {
    for (const label of document.querySelectorAll(".mantine-Slider-markLabel")) {
      const event = isNaN(label.textContent), wrapper = label.closest(".mantine-Slider-markWrapper");
      label.style.visibility = event ? "hidden" : "";
      if (!wrapper || wrapper.title === (event ? label.textContent : "")) continue;
      wrapper.title = event ? label.textContent : "";
      for (const part of [wrapper, ...wrapper.children]) part.style.pointerEvents = event ? "auto" : "";
    }
  }, EVERY_MS);

  // A button that was clicked keeps the focus, and would take the space bar, which pauses.
  document.addEventListener("click", event => {
    if (event.detail) event.target.closest?.("button, [role=tab]")?.blur();
  });

  // viser explains a setting on its box alone: its name does so too.
  for (const kind of ["mouseenter", "mouseleave"]) {
    document.addEventListener(kind, event => {
      const name = event.target;
      if (!name.matches?.("label[for]")) return;
      let part = document.getElementById(name.htmlFor);
      for (; part && part !== document.body; part = part.parentElement) {
        part.dispatchEvent(new MouseEvent(kind, {clientX: event.clientX, clientY: event.clientY}));
        if (part.parentElement?.contains(name)) break;
      }
    }, true);
  }

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
