// The theme wraps tables in regions that scroll; the keyboard must reach those that do.
document$.subscribe(() => {
  requestAnimationFrame(() => {
    for (const region of document.querySelectorAll(".md-typeset__scrollwrap, .diagram")) {
      if (region.scrollWidth > region.clientWidth) {
        region.tabIndex = 0;
        region.setAttribute("role", "region");
        const kind = region.classList.contains("diagram") ? "Diagram" : "Table";
        region.setAttribute("aria-label", `${kind}, scrolls sideways`);
      }
    }
  });
});
