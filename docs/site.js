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

// The controls of a clip hide its lower half, so they are there only while they are of use.
document$.subscribe(() => {
  for (const video of document.querySelectorAll("video")) {
    video.tabIndex = 0;
    video.controls = false;
    for (const [event, shown] of [["pointerenter", true], ["focus", true], ["pointerleave", false], ["blur", false]]) {
      video.addEventListener(event, () => {
        video.controls = shown;
      });
    }
  }
});
