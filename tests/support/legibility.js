// Texts of a page that are hard to read: with low contrast (WCAG 2.2, 1.4.3), or overlapping.

const problems = [];
const rgba = (text) => {
  const [r, g, b, a = 1] = text.match(/[\d.]+/g).map(Number);
  return [r, g, b, a];
};
const over = ([r, g, b, a], under) => [r, g, b].map((part, at) => part * a + under[at] * (1 - a));
const luminance = (colour) => {
  const [r, g, b] = colour.map((part) => (part <= 10.3 ? part / 3294.6 : ((part / 255 + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const ancestors = (element) => (element ? [element, ...ancestors(element.parentElement)] : []);
const isDark = matchMedia("(prefers-color-scheme: dark)").matches;
const ground = (element) => ancestors(element).reverse().reduce((under, it) => over(rgba(getComputedStyle(it).backgroundColor), under), isDark ? [18, 18, 18] : [255, 255, 255]);

/// Returns the part of a rectangle that scrolled ancestors show.
function shown({ left, top, right, bottom }, element) {
  for (const it of ancestors(element)) {
    if (it === document.body || getComputedStyle(it).overflow === "visible") continue;
    const clip = it.getBoundingClientRect();
    [left, top, right, bottom] = [Math.max(left, clip.left), Math.max(top, clip.top), Math.min(right, clip.right), Math.min(bottom, clip.bottom)];
  }
  return { left, top, right, bottom };
}

const texts = [];
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walker.nextNode()) {
  const node = walker.currentNode;
  const element = node.parentElement;
  if (!node.data.trim() || element.closest(".unseen, script, style, option") || !element.checkVisibility()) continue;
  const range = document.createRange();
  range.selectNodeContents(node);
  const boxes = [...range.getClientRects()].map((box) => shown(box, element)).filter((box) => box.right - box.left > 2 && box.bottom - box.top > 2);
  texts.push({ text: node.data.trim().slice(0, 40), element, boxes });
}
for (const element of document.querySelectorAll("select")) {
  if (element.checkVisibility()) texts.push({ text: element.id, element, boxes: [element.getBoundingClientRect()] });
}
for (const { text, element } of texts) {
  const style = getComputedStyle(element);
  const under = ground(element);
  const [light, dark] = [luminance(over(rgba(style.color), under)), luminance(under)].sort((a, b) => b - a);
  const size = parseFloat(style.fontSize);
  const isLarge = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700);
  const contrast = (light + 0.05) / (dark + 0.05);
  if (contrast < (isLarge ? 3 : 4.5)) problems.push(`"${text}" has a contrast of ${contrast.toFixed(2)}`);
}
// Header and footer are fixed, and the rest scrolls below them.
const layer = (element) => element.closest("header, footer")?.tagName;
texts.forEach((one, at) => {
  for (const other of texts.slice(at + 1)) {
    if (layer(one.element) !== layer(other.element)) continue;
    const lie = one.boxes.some((a) => other.boxes.some((b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 2));
    if (lie) problems.push(`"${one.text}" is over "${other.text}"`);
  }
});
if (texts.length < 20) problems.push(`there are only ${texts.length} texts`);
return problems;
