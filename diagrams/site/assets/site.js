// Names for screen readers, and keys, for what the theme adds while a page runs.
new MutationObserver(() => {
  document.querySelectorAll(".md-typeset__scrollwrap:not([tabindex])").forEach((table) => {
    table.tabIndex = 0;
  });
  document.querySelectorAll(".md-code__nav:not([aria-label])").forEach((buttons, place) => {
    buttons.setAttribute("aria-label", `Code ${place + 1}`);
  });
}).observe(document.documentElement, { childList: true, subtree: true });
