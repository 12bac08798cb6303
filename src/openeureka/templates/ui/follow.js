// Hears what has changed, and puts it in the place of what was there.
"use strict";

const parts = document.getElementById("parts");
const lost = document.getElementById("lost");

// A browser that fetches the first picture of eighty films at once takes seconds: each waits until it can be seen.
const films = new IntersectionObserver((entries) => {
  for (const { isIntersecting, target } of entries) if (isIntersecting) target.preload = "metadata";
});
const awaitFilms = () => parts.querySelectorAll("video[preload=none]").forEach((film) => films.observe(film));

/** What a fold is known by; how many replies and candidates there are may grow. */
const called = (details) => details.querySelector("summary").textContent.replace(/^((Reply|Generation) \d+).*/s, "$1");

/** Cards are parts of their own, so that news of one leaves the films of the others alone: they fold with their generation. */
function fold() {
  for (const { dataset, open } of parts.querySelectorAll("details[data-cards]")) {
    for (const part of parts.children) if (part.dataset.part.startsWith(dataset.cards)) part.hidden = !open;
  }
}

/** What a person has unfolded, chosen or zoomed into in a part stays so when the part is renewed. */
function keep(old, part) {
  const unfolded = new Map([...old.querySelectorAll("details")].map((details) => [called(details), details.open]));
  for (const details of part.querySelectorAll("details")) details.open = unfolded.get(called(details)) ?? details.open;
  const chosen = new Set([...old.querySelectorAll("input:checked")].map((box) => box.value));
  for (const box of part.querySelectorAll("input[type=checkbox]")) box.checked = chosen.has(box.value);
  const charts = [...old.querySelectorAll(".chart")].filter(eureka.of);
  for (const fresh of part.querySelectorAll(".chart")) {
    const title = fresh.querySelector("figcaption").textContent;
    const index = charts.findIndex((chart) => chart.querySelector("figcaption").textContent === title);
    if (index < 0) continue;
    const [chart] = charts.splice(index, 1);
    fresh.replaceWith(chart);
    if (chart.dataset.chart !== fresh.dataset.chart) eureka.update(chart, fresh);
  }
}

/** Brings what scrolls in a renewed part to where a person had scrolled it; called while the old one is still shown. */
function scrolled(part) {
  const found = (shown) => [...shown.querySelectorAll(".scroll, pre")];
  const places = found(part).map(({ scrollLeft, scrollTop }) => ({ scrollLeft, scrollTop }));
  return (fresh) => found(fresh).forEach((box, index) => {
    const { scrollLeft, scrollTop } = places[index] ?? {};
    if (scrollLeft || scrollTop) Object.assign(box, { scrollLeft, scrollTop });
  });
}

/** Gives the focus to what stands in a renewed part where it was before. */
function refocus(part) {
  const active = part.contains(document.activeElement) ? document.activeElement : null;
  const like = ({ tagName, name, value, textContent }) => [tagName, name, value, textContent].join("\n");
  const sought = active && like(active);
  return (fresh) => [...fresh.querySelectorAll(active?.tagName ?? ":not(*)")].find((one) => like(one) === sought)?.focus({ preventScroll: true });
}

function renew({ order, changed }) {
  const shown = new Map([...parts.children].map((part) => [part.dataset.part, part]));
  order.forEach(([name, mark], index) => {
    const part = shown.get(name) ?? document.createElement("div");
    // Moving a part would stop its video: only what is out of place is moved.
    if (parts.children[index] !== part) parts.insertBefore(part, parts.children[index] ?? null);
    if (part.dataset.mark === mark) return;
    const old = document.createElement("div");
    const focused = refocus(part), placed = scrolled(part);
    const fresh = document.createElement("template");
    fresh.innerHTML = changed[mark];
    old.append(...part.childNodes);
    part.replaceChildren(fresh.content);
    Object.assign(part.dataset, { part: name, mark });
    keep(old, part);
    focused(part);
    eureka.dress(part);
    placed(part);
    part.querySelectorAll("[data-play]").forEach(eureka.play);
  });
  while (parts.children.length > order.length) parts.lastElementChild.remove();
  fold();
  awaitFilms();
}

const SILENCE = 25000;  // [ms], two and a half beats of ui/follow.py
let source = null;
let timer = 0;
let pressed = false;
const waiting = [];

/** What is replaced between a press and its release is not clicked: news waits for the release. */
function hear(news) {
  waiting.push(news);
  if (!pressed) waiting.splice(0).forEach(renew);
}

function release() {
  pressed = false;
  setTimeout(() => { if (!pressed) waiting.splice(0).forEach(renew); });  // after the click
}

function lose() {
  source?.close();
  lost.hidden = false;
  clearTimeout(timer);
  timer = setTimeout(follow, 2000);
}

/** A connection that breaks without a word, as when a laptop sleeps or a tunnel stalls, looks open for ever. */
function awaitBeat() {
  clearTimeout(timer);
  timer = setTimeout(lose, SILENCE);
}

/** Browsers hold few connections to one server: a tab that nobody looks at gives its own back. */
function follow() {
  source?.close();
  source = null;
  clearTimeout(timer);
  if (document.hidden) return;
  const address = new URL(parts.dataset.address, location.origin);
  address.searchParams.set("shown", [...parts.children].map((part) => part.dataset.mark).join(","));
  source = new EventSource(address);
  source.onopen = () => { lost.hidden = true; };
  source.onmessage = ({ data }) => {
    awaitBeat();
    hear(JSON.parse(data));
  };
  source.addEventListener("beat", awaitBeat);
  source.onerror = lose;
  awaitBeat();
}

addEventListener("pointerdown", () => { pressed = true; }, true);
for (const end of ["pointerup", "pointercancel"]) addEventListener(end, release, true);
addEventListener("blur", release);  // of the window alone
document.addEventListener("visibilitychange", follow);
addEventListener("pagehide", () => source?.close());
parts.addEventListener("toggle", fold, true);
fold();
awaitFilms();
follow();
