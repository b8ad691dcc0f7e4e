// Mathematics of pages (arithmatex) and of notebooks, by KaTeX, which lies beside this file:
// the site needs no network.
const DELIMITERS = [
  { left: "$$", right: "$$", display: true },
  { left: "\\[", right: "\\]", display: true },
  { left: "$", right: "$", display: false },
  { left: "\\(", right: "\\)", display: false },
];
document.addEventListener("DOMContentLoaded", () => {
  document
    .querySelectorAll(".arithmatex, .jp-RenderedMarkdown")
    .forEach((part) => renderMathInElement(part, { delimiters: DELIMITERS }));
});
