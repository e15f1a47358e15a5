// Additions to viser's widgets that its Python API lacks: rows of tables that choose, and commands of the palette that
// turn to a tab.
"use strict";
(() => {
  // An element with data-pick="WIDGET" data-value="VALUE" sets that (hidden) widget: by a click, by Enter, and with
  // data-hover also while the pointer is over it; data-rest is what it is set to when the pointer leaves.
  const send = (element, value) => window.__viserMutable?.sendMessage?.(
    {type: "GuiUpdateMessage", uuid: element.dataset.pick, updates: {value}});
  const picked = event => event.target.closest?.("[data-pick]");
  document.addEventListener("click", event => {
    const element = picked(event);
    if (element) send(element, element.dataset.value);
  });
  document.addEventListener("keydown", event => {
    const element = event.key === "Enter" ? picked(event) : null;
    if (element) send(element, element.dataset.value);
  });
  let over = null;
  document.addEventListener("mouseover", event => {
    const element = event.target.closest?.("[data-hover]") ?? null;
    if (element?.dataset.hover === over?.dataset.hover) return;
    if (element) send(element, element.dataset.hover);
    else if (over) send(over, over.dataset.rest);
    over = element;
  });

  // A browser alone can turn to a tab or open a file chooser: these commands press a button of a tab, of their own name.
  const TABS = {"Open a file": "Scene", "Screenshot": "Export", "Export": "Export"}, PATIENCE_MS = 2000;
  const labelled = (kind, text) => [...document.querySelectorAll(kind)].find(each => each.textContent.trim() === text);
  const press = (label, since) => {
    const button = labelled("button", label);
    if (button) button.click();
    else if (performance.now() - since < PATIENCE_MS) requestAnimationFrame(() => press(label, since));
  };
  document.addEventListener("click", event => {
    const command = event.target.closest?.(".mantine-Spotlight-action");
    const label = command?.querySelector(".mantine-Spotlight-actionLabel")?.textContent;
    const tab = TABS[label];
    if (!tab || command.style.cursor === "not-allowed") return;
    const there = labelled("[role=tab]", tab);
    there?.dispatchEvent(new KeyboardEvent("keydown", {key: "Enter", bubbles: true}));  // docked tabs take no click
    there?.click();
    if (label !== tab) press(label, performance.now());
  }, true);

  // viser writes keys as browsers name them.
  const KEYS = {pageup: "Page Up", pagedown: "Page Down", space: "Space", escape: "Esc"};
  const NAMES = /\b(pageup|pagedown|space|escape)\b(?=\)?$)/;
  new MutationObserver(() => {
    for (const text of document.querySelectorAll(".mantine-Spotlight-actionDescription")) {
      const node = text.firstChild;
      if (node?.nodeType === Node.TEXT_NODE && NAMES.test(node.nodeValue)) {
        node.nodeValue = node.nodeValue.replace(NAMES, key => KEYS[key]);
      }
    }
  }).observe(document.body, {childList: true, subtree: true});
})();
