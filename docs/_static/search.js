/* Words next to a page are taken from its text, without the buttons above it and the list of headings. */
document.addEventListener("DOMContentLoaded", () => {
  if (typeof Search === "undefined") return;
  const whole = Search.htmlToText;
  Search.htmlToText = (page, anchor) => {
    const parsed = new DOMParser().parseFromString(page, "text/html");
    const article = parsed.querySelector("article");
    if (!article) return whole(page, anchor);
    article.setAttribute("role", "main");
    return whole(article.outerHTML, anchor);
  };
});
