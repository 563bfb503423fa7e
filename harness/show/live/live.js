// The live page: reads the form, asks /fly for it, draws the answer. One flight at a time; while one is under way, the
// latest wish waits. The address of the page always says what is shown.
'use strict';
const find = (id) => document.getElementById(id);
const sliders = [...document.querySelectorAll('input[type=range]')];
const dark = window.matchMedia('(prefers-color-scheme: dark)');
const config = {responsive: true, displaylogo: false, modeBarButtonsToRemove: ['toImage']};
const constants = ['load_torque', 'supply_voltage'];
let shown = null, flying = false, waiting = false;

function query() {
  const asked = new URLSearchParams();
  asked.set('trial', find('trial').value);
  asked.set('fidelity', [...document.querySelectorAll('[name=fidelity]:checked')].map((box) => box.value).join(','));
  if (find('actuator').value) asked.set('actuator', find('actuator').value);
  for (const slider of sliders) if (slider.dataset.moved) asked.append('set', `${slider.id}=${slider.value}`);
  for (const id of constants) {
    if (find(id).value.trim()) asked.append('set', `${id}=${find(id).value.trim().replace(',', '.')}`);
  }
  for (const line of find('parameters').value.split('\n')) if (line.trim()) asked.append('set', line.trim());
  if (find('residuals').checked) asked.set('residuals', '1');
  return asked;
}

function say(line) {
  const told = document.createElement('p');
  told.className = 'verdict over';
  told.setAttribute('role', 'alert');
  told.textContent = line;
  find('banner').replaceChildren(told);
}

// The answer to a request, or an error that says why there is none; a server that is busy with us is asked again.
async function ask(address, options) {
  for (let attempt = 0; ; attempt += 1) {
    let answer;
    try {
      answer = await fetch(address, options);
    } catch {
      throw new Error('The server does not answer: is ema serve still running?');
    }
    if (answer.ok) return answer;
    if ((answer.status !== 429 && answer.status !== 503) || attempt > 40) {
      const said = await answer.json().catch(() => ({}));
      throw new Error(said.error || `The server answers with status ${answer.status}.`);
    }
    await new Promise((resume) => setTimeout(resume, 250));
  }
}

async function fly() {
  if (flying) { waiting = true; return; }
  flying = true;
  document.querySelector('main').classList.add('busy');
  do {
    waiting = false;
    try {
      const answer = await (await ask(`fly?${query()}`)).json();
      if (!waiting) show(answer);
    } catch (error) {
      if (!waiting) say(error.message);
    }
  } while (waiting);
  flying = false;
  document.querySelector('main').classList.remove('busy');
}

function show(answer) {
  find('banner').innerHTML = answer.banner;
  find('about').innerHTML = answer.about;
  find('table').innerHTML = answer.table;
  find('command').textContent = answer.command;
  find('note').textContent = answer.note;
  const link = answer.query ? `./?${answer.query}` : './';
  find('link').href = link;
  history.replaceState(null, '', link);
  for (const slider of sliders) {
    slider.dataset.start = answer.starts[slider.id];
    if (!slider.dataset.moved) slider.value = answer.starts[slider.id];
    tell(slider);
  }
  for (const id of constants) find(id).placeholder = answer.starts[id];
  shown = answer.figure;
  find('figure').setAttribute('aria-label', answer.spoken);
  find('figure').classList.toggle('tall', find('residuals').checked && answer.figure.layout.yaxis4 !== undefined);
  draw();
}

function painted(layout, ink, line, panel) {
  const own = {...layout, font: {...layout.font, color: ink}, hoverlabel: {bgcolor: panel, font: {color: ink}}};
  for (const axis of Object.keys(layout).filter((key) => /^[xy]axis\d*$/.test(key))) {
    own[axis] = {...layout[axis], gridcolor: line, zerolinecolor: line, linecolor: line};
  }
  return own;
}

function draw() {
  if (!shown) return;
  const style = getComputedStyle(document.documentElement);
  const [ink, line, panel] = ['--text', '--line', '--panel'].map((name) => style.getPropertyValue(name).trim());
  const narrow = window.innerWidth < 700;
  const data = narrow ? shown.data.filter((trace) => trace.visible !== 'legendonly') : shown.data;
  Plotly.react('figure', data, painted(shown.layout, ink, line, panel), config);
}

// Pictures are for paper: dark on white, whatever the screen.
async function picture(format) {
  if (!shown) return;
  const seen = find('figure');
  const data = shown.data.map((trace, place) => ({...trace, visible: seen.data[place]?.visible ?? true}));
  const layout = {...painted(shown.layout, '#1b1f24', '#d9dee4', '#ffffff'), paper_bgcolor: '#fff', plot_bgcolor: '#fff'};
  for (const axis of Object.keys(layout).filter((key) => /^[xy]axis\d*$/.test(key))) {
    layout[axis] = {...layout[axis], range: [...seen._fullLayout[axis].range], autorange: false};
  }
  const options = {format, width: 1000, height: seen.classList.contains('tall') ? 1200 : 800, scale: format === 'png' ? 2 : 1};
  const address = await Plotly.toImage({data, layout}, options);
  save(address, `${find('trial').selectedOptions[0].textContent.replace(/\W+/g, '_')}.${format}`);
}

function save(address, name) {
  const link = document.createElement('a');
  link.href = address;
  link.download = name;
  link.click();
}

async function download(what) {
  try {
    const answer = await ask(`${what}?${query()}`);
    const name = /filename="(.*)"/.exec(answer.headers.get('Content-Disposition'))[1];
    const address = URL.createObjectURL(await answer.blob());
    save(address, name);
    setTimeout(() => URL.revokeObjectURL(address), 10000);
  } catch (error) {
    say(error.message);
  }
}

async function upload(input) {
  const file = input.files[0];
  if (!file) return;
  const asked = new URLSearchParams({kind: input.dataset.kind, name: file.name, actuator: find('actuator').value});
  try {
    const sent = {method: 'POST', headers: {'Content-Type': 'application/octet-stream'}, body: file};
    const {token, name} = await (await ask(`file?${asked}`, sent)).json();
    const list = find(input.dataset.kind);
    if (![...list.options].some((option) => option.value === token)) list.add(new Option(name, token));
    list.value = token;
    fly();
  } catch (error) {
    say(error.message);
  }
  input.value = '';
}

// A slider that was not moved shows what the actuator has, to the last digit.
function tell(slider) {
  const value = slider.dataset.moved ? Number(slider.value) : Number(slider.dataset.start);
  const text = `${Number(value.toPrecision(6))}${slider.nextElementSibling.dataset.unit}`;
  slider.nextElementSibling.textContent = text;
  slider.setAttribute('aria-valuetext', text);
}

for (const slider of sliders) {
  slider.addEventListener('input', () => {
    if (Number(slider.value) === Number(slider.dataset.start)) delete slider.dataset.moved;
    else slider.dataset.moved = '1';
    tell(slider);
  });
  tell(slider);
}
find('wish').addEventListener('submit', (event) => event.preventDefault());
find('wish').addEventListener('input', (event) => {
  if (event.target.type === 'range' || event.target.type === 'checkbox') fly();
});
find('wish').addEventListener('change', (event) => {
  if (event.target.type === 'file') { upload(event.target); return; }
  if (event.target.id === 'port') {
    const option = [...find('ports').children].find((each) => each.value === event.target.value);
    if (!option) return;
    const unit = ['', '1'].includes(option.dataset.unit) ? '' : ` ${option.dataset.unit}`;
    const before = find('parameters').value.trim();
    find('parameters').value = `${before}${before && '\n'}${option.value}=${option.dataset.start}${unit}`;
    event.target.value = '';
    find('parameters').focus();
    return;
  }
  if (event.target.type !== 'range' && event.target.type !== 'checkbox') fly();
});
document.querySelectorAll('[data-picture]').forEach((button) => {
  button.addEventListener('click', () => picture(button.dataset.picture));
});
find('csv').addEventListener('click', () => download('csv'));
find('fmu').addEventListener('click', () => download('fmu'));
find('link').addEventListener('click', (event) => {
  if (!navigator.clipboard || event.ctrlKey || event.metaKey) return;
  event.preventDefault();
  navigator.clipboard.writeText(event.target.href).then(() => {
    event.target.textContent = 'Link copied';
    setTimeout(() => { event.target.textContent = 'Link to this view'; }, 1500);
  }, () => { location.href = event.target.href; });
});
dark.addEventListener('change', draw);
find('faults').addEventListener('toggle', () => { if (shown) Plotly.Plots.resize('figure'); });
if (window.innerWidth < 960 && !find('faults').querySelector('[data-moved]')) find('faults').open = false;
if (!find('banner').dataset.problem) fly();
