// Asks now and then what has changed, and puts it in the place of what was there.
"use strict";

const main = document.querySelector("main");

// A browser that fetches the first picture of eighty films at once takes seconds: each waits until it can be seen.
const films = new IntersectionObserver((entries) => {
  for (const { isIntersecting, target } of entries) if (isIntersecting) target.preload = "metadata";
});
const awaitFilms = () => main.querySelectorAll("video[preload=none]").forEach((film) => films.observe(film));

/** What a person has unfolded or chosen in a part stays so when the part is renewed. */
function keep(old, renewed) {
  const unfolded = [...old.querySelectorAll("details")];
  [...renewed.querySelectorAll("details")].forEach((details, index) => { details.open = unfolded[index]?.open ?? details.open; });
  const chosen = new Set([...old.querySelectorAll("input:checked")].map((box) => box.value));
  for (const box of renewed.querySelectorAll("input[type=checkbox]")) box.checked = chosen.has(box.value);
}

function renew({ order, changed }) {
  const shown = new Map([...main.children].map((part) => [part.dataset.part, part]));
  order.forEach(([name, mark], index) => {
    const part = shown.get(name) ?? document.createElement("div");
    if (part.dataset.mark !== mark) {
      const fresh = document.createElement("template");
      fresh.innerHTML = changed[mark];
      keep(part, fresh.content);
      part.replaceChildren(fresh.content);
      Object.assign(part.dataset, { part: name, mark });
    }
    // Moving a part would stop its video: only what is out of place is moved.
    if (main.children[index] !== part) main.insertBefore(part, main.children[index] ?? null);
  });
  while (main.children.length > order.length) main.lastElementChild.remove();
  awaitFilms();
}

async function look() {
  const marks = [...main.children].map((part) => part.dataset.mark);
  const answer = await fetch(new URL(main.dataset.address, location.origin), { headers: { "X-Shown": marks.join(",") } });
  if (!answer.ok) throw new Error(answer.statusText);
  if (answer.status === 200) renew(await answer.json());
  return Number(answer.headers.get("X-Pause"));
}

async function follow(pause) {
  const lost = document.getElementById("lost");
  for (;;) {
    await new Promise((wake) => setTimeout(wake, 1000 * pause));
    if (document.hidden) continue;
    try {
      pause = await look();
      lost.hidden = true;
    } catch {
      lost.hidden = false;
    }
  }
}

awaitFilms();
follow(Number(main.dataset.pause));
