// A stand-in for VS Code: `node vscode_stub.js EXTENSION.js DECK COMMAND...` opens a deck in the extension, asks what an
// editor asks, and prints what it would show as JSON.
'use strict';

const Module = require('module');
const fs = require('fs');

const [, , extension, deck, ...command] = process.argv;
const text = fs.readFileSync(deck, 'utf8');
const made = {}; // what the extension has registered, by kind
const shown = { diagnostics: {}, messages: [], terminals: [] };
const subscription = { dispose() {} };
const listen = () => subscription;
const record = (kind) => (...given) => { made[kind] = given; return subscription; };

class Kept {
  constructor(...given) { this.given = given; }
}
const uri = (path) => ({ toString: () => `file://${path}`, fsPath: path, scheme: 'file' });
const document = {
  uri: uri(deck), languageId: 'met', version: 1, isUntitled: false, getText: () => text,
};
const kinds = ['CompletionItem', 'Hover', 'Definition', 'Reference', 'Rename', 'DocumentSymbol', 'FoldingRange',
  'DocumentFormattingEdit', 'CodeActions', 'CodeLens', 'DocumentSemanticTokens'];
const watcher = { ...subscription, onDidCreate: listen, onDidChange: listen, onDidDelete: listen };
const changes = {};

const vscode = {
  Uri: { parse: (address) => uri(address.replace('file://', '')) },
  MarkdownString: Kept, SemanticTokens: Kept, SemanticTokensLegend: Kept, FoldingRange: Kept, Hover: Kept,
  CompletionItem: Kept, DocumentSymbol: Kept, CodeAction: Kept, CodeLens: Kept, DiagnosticRelatedInformation: Kept, Diagnostic: Kept,
  EventEmitter: class { constructor() { this.event = listen; } fire() { shown.refreshed = (shown.refreshed || 0) + 1; } },
  CodeActionKind: { QuickFix: 'quickfix' },
  Range: class { constructor(...at) { Object.assign(this, { start: { line: at[0], character: at[1] }, end: at.slice(2) }); } },
  Location: class { constructor(where, range) { Object.assign(this, { uri: where, range }); } },
  TextEdit: class { constructor(range, newText) { Object.assign(this, { range, newText }); } },
  WorkspaceEdit: class { constructor() { this.changes = {}; } set(where, edits) { this.changes[where] = edits; } },
  languages: Object.fromEntries(kinds.map((kind) => [`register${kind}Provider`, record(kind)])),
  commands: { registerCommand: (name, run) => { made[name] = run; return subscription; } },
  workspace: {
    getConfiguration: () => ({ get: (key) => ({ command: command[0], includeDirs: [], defines: [] })[key] }),
    workspaceFolders: [{ uri: uri(require('path').dirname(deck)), name: 'decks' }],
    textDocuments: [document],
    createFileSystemWatcher: () => watcher,
    ...Object.fromEntries(['Open', 'Close', 'Save'].map((each) => [`onDid${each}TextDocument`, listen])),
    onDidChangeTextDocument: (changed) => { changes.tell = changed; return subscription; },
  },
  Task: class { constructor(...given) { this.execution = given[4]; } },
  ProcessExecution: class { constructor(...given) { this.given = given; } },
  TaskScope: {}, TaskRevealKind: {},
  tasks: { executeTask: ({ execution }) => shown.terminals.push([execution.given[0], ...execution.given[1]]) },
  window: {
    activeTextEditor: { document },
    createOutputChannel: () => ({ append() {}, appendLine: (line) => shown.messages.push(line), ...subscription }),
    showWarningMessage: (line) => shown.messages.push(line),
    showErrorMessage: (line) => shown.messages.push(line),
  },
};
vscode.languages.createDiagnosticCollection = () => ({
  set: (where, found) => { shown.diagnostics[where] = found.map((each) => [each.code, ...each.given.slice(1)]); },
  clear() {}, ...subscription,
});

const load = Module._load;
Module._load = (name, ...rest) => (name === 'vscode' ? vscode : load(name, ...rest));
const loaded = require(extension);

const at = (mark) => {
  const before = text.slice(0, text.indexOf(mark)).split('\n');
  return { line: before.length - 1, character: before.at(-1).length };
};
const never = { onCancellationRequested: listen };
const wait = (seconds) => new Promise((done) => setTimeout(done, 1000 * seconds));

(async () => {
  loaded.activate({ subscriptions: [] });
  for (let n = 0; n < 2000 && !shown.diagnostics[document.uri]; n += 1) await wait(0.1);
  const provider = (kind) => made[kind][0].language === 'met' && made[kind][1];
  const place = at('motor like');
  const completed = await provider('CompletionItem').provideCompletionItems(document, at('kp ='), never);
  const hovered = await provider('Hover').provideHover(document, at('duration'), never);
  const defined = await provider('Definition').provideDefinition(document, at('motor;'), never);
  const used = await provider('Reference').provideReferences(document, place, { includeDeclaration: true }, never);
  const symbols = await provider('DocumentSymbol').provideDocumentSymbols(document, never);
  const folds = await provider('FoldingRange').provideFoldingRanges(document, {}, never);
  const laid = await provider('DocumentFormattingEdit').provideDocumentFormattingEdits(document, {}, never);
  const coloured = await provider('DocumentSemanticTokens').provideDocumentSemanticTokens(document, never);
  const named = await provider('Rename').prepareRename(document, place, never);
  const renamed = await provider('Rename').provideRenameEdits(document, place, 'drive', never).catch((e) => e.message);
  const wrong = await provider('Rename').provideRenameEdits(document, place, 'kg', never).catch((e) => e.message);
  const lenses = await provider('CodeLens').provideCodeLenses(document, never);
  for (const each of lenses) if (each.given[1].command) made[each.given[1].command](...each.given[1].arguments);
  made['met.run']();
  Object.assign(shown, {
    lenses: lenses.map((each) => each.given[1].title),
    completed: completed.map((each) => each.given[0]),
    hovered: hovered.given[0].given[0],
    defined: defined.map((each) => each.range.start),
    used: used.length,
    symbols: symbols.map((each) => each.given[0]),
    folds: folds.map((each) => each.given),
    laid: laid.length,
    coloured: coloured.given[0].length,
    named: named.placeholder,
    renamed: renamed.changes ? Object.values(renamed.changes).flat().length : renamed,
    wrong,
  });
  loaded.deactivate();
  fs.writeSync(1, JSON.stringify(shown));
  process.exit(0);
})().catch((error) => { console.error(error); process.exit(1); });
