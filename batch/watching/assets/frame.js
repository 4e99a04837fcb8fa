// The page around the run of a deck that is watched. It hears what is new, fetches it, and gives it to the page of the runs.
// Texts of a deck come in as text nodes alone.
"use strict";

(() => {
  const READY = 400;  // ms, in which a page that nobody sees draws nothing
  const make = (tag, about = {}, ...children) => {
    const made = Object.assign(document.createElement(tag), about);
    made.append(...children);
    return made;
  };
  const name = make("code");
  const doing = make("span", { className: "doing" });
  doing.setAttribute("role", "status");
  const runs = make("select", { onchange: () => choose({ run: runs.value }) });
  const groups = make("select", { onchange: () => choose({ run: state.run, group: groups.value }) });
  const [ofRun, ofGroup] = [make("label", {}, "Run ", runs), make("label", {}, "Structure ", groups)];
  const head = make("h2");
  const words = make("pre", { tabIndex: 0 });
  const messages = make("aside", { hidden: true }, head, words);
  const room = make("div", { className: "room" });
  document.body.append(make("header", { className: "deck-bar" }, name, ofRun, ofGroup, doing), make("main", {}, messages, room));

  let state = { page: 0, numbers: 0 };
  let run = null;  // the page of the runs
  let coming = 0;  // the number of the run that was asked for last
  let gone = false;

  async function choose(chosen) {
    await fetch("choose", { method: "POST", body: new URLSearchParams(chosen) });
  }

  function options(select, label, all, chosen) {
    label.hidden = all.length < 2;
    if ([...select.options].map((each) => each.value).join("\n") !== all.join("\n")) select.replaceChildren(...all.map((each) => make("option", { value: each }, each)));
    select.value = chosen;
  }

  const clock = (seconds) => new Date(1000 * seconds).toTimeString().slice(0, 8);
  const ofDeck = /^\s*\d*\s*\|/;  // a line of a file, or the marks under it, which stay one line

  // What `met check` says; told: what was put there last.
  let told = "";
  function say(text) {
    if (told === text) return;
    told = text;
    const parts = [];  // lines of a file that follow one another, which scroll together; and other lines
    text.split("\n").forEach((line) => {
      const last = parts[parts.length - 1];
      if (!ofDeck.test(line)) parts.push(`${line}\n`);
      else if (Array.isArray(last)) last.push(line);
      else parts.push([line]);
    });
    words.replaceChildren(...parts.map((part) => (Array.isArray(part) ? make("span", { className: "of-deck", tabIndex: 0 }, part.join("\n")) : part)));
    reach();
  }

  // The mark under a line comes into sight, also where the line is longer than its place.
  function reach() {
    requestAnimationFrame(() => words.querySelectorAll(".of-deck").forEach((part) => {
      const lines = part.textContent.split("\n");
      const column = Math.max(...lines.map((line) => line.search(/\^/)));
      const longest = Math.max(...lines.map((line) => line.length));
      const mark = (column / longest) * part.scrollWidth;
      if (column >= 0 && mark > 0.8 * part.clientWidth) part.scrollLeft = mark - part.clientWidth / 2;
    }));
  }

  function tell() {
    document.title = `${state.name} · met view`;
    name.textContent = state.name;
    options(runs, ofRun, state.names, state.run);
    options(groups, ofGroup, state.groups, state.group);
    const mistake = state.fault ? "a defect of MET" : "a mistake";
    const broken = state.broken ? `${mistake} since ${clock(state.tried)}` : "";
    const standing = state.page && !state.broken ? `as saved at ${clock(state.saved)}` : "";
    doing.textContent = gone ? "met view has ended: nothing is watched any more" : [broken, state.doing || standing].filter(Boolean).join(" · ");
    doing.classList.toggle("bad", gone || state.broken);
    messages.hidden = !state.messages;
    messages.classList.toggle("bad", state.broken);
    const beside = state.page ? `shown is the run as saved at ${clock(state.saved)}` : "there is no run to show yet";
    head.textContent = state.broken ? `A${mistake.slice(1)}: ${beside}` : "Warnings";
    say(state.messages);
  }

  function take(news) {
    state = news;
    tell();
    if (state.page && state.page !== coming) load(state.page);
    deliver();
  }

  // The page of the runs, until it can be given one; {frame, ready: what it is told by, page, numbers: of what it shows}.
  function begin() {
    const frame = make("iframe", { src: "run", title: "The run", className: "coming" });
    const ready = new Promise((done) => frame.addEventListener("load", () => done(frame.contentWindow.metKept)));
    room.replaceChildren(frame);
    return { frame, ready, page: 0, numbers: 0 };
  }

  // A new run takes the place of the one that is seen.
  async function load(page) {
    coming = page;
    run ||= begin();
    const { frame, ready } = run;
    const [kept, answer] = await Promise.all([ready, fetch(`page/${page}`)]);
    const data = answer.ok && await answer.json();
    if (coming !== page) return;
    if (!kept || !data) {  // it was gone before it was fetched: another comes
      [coming, run] = [0, kept ? run : null];
      return;
    }
    const before = run;
    run = null;  // where it fails, the next one begins anew
    kept.become(data);
    run = Object.assign(before, { page, numbers: 0 });
    frame.className = "";
    deliver();
    let drawn = false;
    const done = () => {
      if (!drawn && run?.page === page) document.documentElement.dataset.shown = page;
      drawn = true;
    };
    frame.contentWindow.requestAnimationFrame(() => frame.contentWindow.requestAnimationFrame(done));
    setTimeout(done, READY);
  }

  // What came of the cases, to the page that they are of.
  async function deliver() {
    const { numbers } = state;
    if (!run || run.page !== state.page || !numbers || run.numbers === numbers) return;
    const to = run;
    to.numbers = numbers;
    const answer = await fetch(`numbers/${numbers}`);
    const found = answer.ok && await answer.json();
    if (!found || run !== to || to.numbers !== numbers) return;
    to.frame.contentWindow.metKept.arrive(found);
    document.documentElement.dataset.numbers = numbers;
  }

  // A browser opens six connections to a server: so of all its tabs one hears what is new, and tells the others. When that
  // one is closed, another takes its place.
  const mine = location.pathname;
  const others = new BroadcastChannel(mine);
  let [news, hears] = [null, false];
  const heard = (found) => { [news, gone] = [found, false]; take(found); };
  const lost = () => { gone = true; if (state.name) tell(); };

  function hear() {
    hears = true;
    const events = new EventSource("events");
    events.onmessage = (event) => { heard(JSON.parse(event.data)); others.postMessage({ news }); };
    events.onerror = () => { lost(); others.postMessage({ lost: true }); };
  }

  others.onmessage = ({ data }) => {
    if (data.asks && hears && news) others.postMessage(gone ? { lost: true } : { news });
    else if (data.news) heard(data.news);
    else if (data.lost) lost();
  };
  others.postMessage({ asks: true });
  if (navigator.locks) navigator.locks.request(mine, () => new Promise(hear));
  else hear();
})();
