-- Neovim as its user drives it: the settings of docs/editors.md, a deck with a mistake, its fix, what a word means.
-- nvim --headless -u NONE -l is newer than what is tried; so: nvim --headless -u NONE -c "luafile neovim.lua" arm.ic
local function say(text) io.stdout:write(text .. "\n") end
local options = { name = "met", cmd = { vim.env.MET_COMMAND, "lsp" }, root_dir = vim.fn.getcwd(), init_options = { helpInMessage = true } }
local client = vim.lsp.start_client(options)
vim.lsp.buf_attach_client(0, client)
local function ask(method, more)
  local parameters = vim.tbl_extend("force", { textDocument = vim.lsp.util.make_text_document_params() }, more)
  for _, answer in pairs(vim.lsp.buf_request_sync(0, method, parameters, 60000) or {}) do
    if answer.error then return nil, answer.error.message end
    return answer.result
  end
end
vim.wait(60000, function() return #vim.diagnostic.get(0) > 0 end, 50)
for _, each in ipairs(vim.diagnostic.get(0)) do say(each.lnum .. " " .. each.code .. " " .. each.message) end
local range = { start = { line = 1, character = 35 }, ["end"] = { line = 1, character = 36 } }
local actions = ask("textDocument/codeAction", { range = range, context = { diagnostics = {} } })
say("action " .. actions[1].title)
vim.lsp.util.apply_workspace_edit(actions[1].edit, "utf-16")
say("line " .. vim.api.nvim_buf_get_lines(0, 1, 2, false)[1])
vim.wait(60000, function() return #vim.diagnostic.get(0) == 0 end, 50)
say("left " .. #vim.diagnostic.get(0))
local at = { position = { line = 1, character = 26 } }
say("hover " .. ask("textDocument/hover", at).contents.value:gsub("\n.*", ""))
local edit = ask("textDocument/rename", { position = { line = 1, character = 4 }, newName = "longer" })
vim.lsp.util.apply_workspace_edit(edit, "utf-16")
say("renamed " .. vim.api.nvim_buf_get_lines(0, 1, 2, false)[1])
local _, reason = ask("textDocument/rename", { position = { line = 1, character = 4 }, newName = "kg" })
say("refused " .. reason)
vim.cmd("qa!")
