"""What a page looks like, measured on the page itself: whether its text can be read, whether its controls are there to be used."""

from __future__ import annotations

from typing import Any

_COMMON = """
const shown = { opacityProperty: true, visibilityProperty: true };
const seen = (element) => element.checkVisibility(shown) && element.getClientRects().length > 0;
const named = (element, text) =>
  `${element.tagName.toLowerCase()}${element.id ? '#' + element.id : ''}.${element.className}: ${text.trim().slice(0, 40)}`;
"""

_COLOURS = """
const parsed = (text) => {
  const numbers = text.match(/[\\d.]+/g).map(Number);
  return { rgb: numbers.slice(0, 3), alpha: numbers.length > 3 ? numbers[3] : 1 };
};
const over = (upper, alpha, lower) => upper.map((value, k) => alpha * value + (1 - alpha) * lower[k]);
const light = (rgb) => {
  const [r, g, b] = rgb.map((value) => value / 255).map((value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const ratio = (one, other) => {
  const [low, high] = [light(one), light(other)].sort((a, b) => a - b);
  return (high + 0.05) / (low + 0.05);
};
/** What lies under an element's text; where nothing hides the picture, that may be anything from black to white. */
const grounds = (element) => {
  const layers = [];
  const upon = (ground) => layers.reduceRight((lower, one) => over(one.rgb, one.alpha, lower), ground);
  for (let at = element; at; at = at.parentElement) {
    if (at.classList.contains('stage')) return [[0, 0, 0], [255, 255, 255]].map(upon);
    const layer = parsed(getComputedStyle(at).backgroundColor);
    layers.push(layer);
    if (layer.alpha === 1) break;
  }
  return [upon([255, 255, 255])];
};
"""

_CONTRAST = """(root) => {
%s
const faint = [];
let read = 0;
const judge = (element, style, text) => {
  if (!text.trim() || element.closest(':disabled') || !seen(element)) return;
  let opacity = 1;
  for (let at = element; at; at = at.parentElement) opacity *= Number(getComputedStyle(at).opacity);
  const colour = parsed(style.color);
  const least = Math.min(...grounds(element).map((ground) => ratio(over(colour.rgb, colour.alpha * opacity, ground), ground)));
  const size = parseFloat(style.fontSize);
  const large = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700);
  read += 1;
  if (least < (large ? 3 : 4.5)) faint.push(`${named(element, text)} has ${least.toFixed(2)}`);
};
const texts = document.createTreeWalker(document.querySelector(root), NodeFilter.SHOW_TEXT);
while (texts.nextNode()) {
  const element = texts.currentNode.parentElement;
  if (!element.closest('select')) judge(element, getComputedStyle(element), texts.currentNode.textContent);
}
for (const field of document.querySelector(root).querySelectorAll('input, select')) {
  if (field.placeholder && !field.value) judge(field, getComputedStyle(field, '::placeholder'), field.placeholder);
  else if (!['checkbox', 'range', 'file'].includes(field.type)) judge(field, getComputedStyle(field), field.value || 'empty');
}
return { read, faint };
}""".replace("%s", _COMMON + _COLOURS)

_DRAWN = """([selector, textFrom]) => {
%s
const canvas = document.querySelector(selector);
const { width, height } = canvas;
const pen = Object.assign(document.createElement('canvas'), { width, height }).getContext('2d', { willReadFrequently: true });
pen.drawImage(canvas, 0, 0);
const { data } = pen.getImageData(0, 0, width, height);
const [ground] = grounds(canvas);
const found = { marks: [], texts: [] };
for (let k = 0; k < width * height; k++) {
  if (data[4 * k + 3] < 128) continue; // the soft border of a sign
  const kind = k >= width * (height - textFrom) ? 'texts' : 'marks';
  found[kind].push(ratio([...data.subarray(4 * k, 4 * k + 3)], ground));
}
return Object.fromEntries(Object.entries(found).map(([kind, ratios]) => [kind, Math.min(...ratios)]));
}""".replace("%s", _COMMON + _COLOURS)

_PLACES = """() => {
%s
const faults = [];
let found = 0;
for (const element of document.querySelectorAll(':is(.top, .side, .stage) :is(button, select, label, input, summary)')) {
  if (!seen(element)) continue;
  if (element.closest('.scroll')) element.scrollIntoView({ block: 'center' });
  const box = element.getBoundingClientRect();
  const text = element.textContent || element.value || '';
  found += 1;
  const cut = box.left < 0 || box.top < 0 || box.right > innerWidth || box.bottom > innerHeight;
  if (cut) faults.push(`${named(element, text)} is cut off`);
  const wide = element.matches('button, label') && element.clientWidth && element.scrollWidth > element.clientWidth + 1;
  if (wide) faults.push(`${named(element, text)} is wider than its place`);
  for (const [x, y] of [[0.5, 0.5], [0.1, 0.2], [0.9, 0.2], [0.1, 0.8], [0.9, 0.8]]) {
    const there = document.elementFromPoint(box.left + x * box.width, box.top + y * box.height);
    if (!element.contains(there)) faults.push(`${named(element, text)} is covered by ${there ? named(there, '') : 'nothing'}`);
  }
}
const sides = ['.top', '.side', '.stage'].map((name) => document.querySelector(name));
for (const part of sides) if (part.scrollWidth > part.clientWidth) faults.push(`${named(part, '')} is wider than the window gives it`);
return { found, faults };
}""".replace("%s", _COMMON)


def faint_texts(page: Any, root: str = "body") -> list[str]:
    """Return the visible texts whose contrast to what lies under them is less than the WCAG asks for; what is disabled may be faint.

    Parameters
    ----------
    page
        Of Playwright.
    root : str
        Selector of the part of the page that is looked at.
    """
    found = page.evaluate(_CONTRAST, root)
    assert found["read"] > 0, f"there is no text in {root}"
    return found["faint"]


def drawn_contrasts(page: Any, selector: str, text_from: int) -> dict[str, float]:
    """Return the least contrast that what is drawn on a canvas has to what lies under it, of marks, and of the texts below them.

    Parameters
    ----------
    page
        Of Playwright.
    selector : str
        Of the canvas.
    text_from : int
        So many rows of pixels at the bottom hold text.
    """
    return page.evaluate(_DRAWN, [selector, text_from])


def misplaced(page: Any) -> list[str]:
    """Return the controls that are cut off, covered, or too narrow for their text."""
    found = page.evaluate(_PLACES)
    assert found["found"] > 10
    return sorted(set(found["faults"]))
